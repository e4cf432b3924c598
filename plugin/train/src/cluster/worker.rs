//! A worker: Worlds that play shares of a training's rollouts.
//!
//! ```
//! use playbot_train::cluster::worker::work;
//!
//! let no_games = |name: &str| Err(format!("this program has no game `{name}`"));
//! // A worker whose training has ended at once.
//! work(&no_games, "playbot 0.1.0", &mut std::io::empty(), &mut std::io::sink())?;
//! # Ok::<(), std::io::Error>(())
//! ```

use crate::{
    cluster::wire::{Answer, Frame, Kind, Order, PROTOCOL, Setup, read_frame, write_frame},
    collect::{Collector, restore_arenas, save_arenas},
    experiment::{Experiment, file::parse_experiment},
    levels::LevelPlan,
};
use bevy_playbot::{fault::Fault, skill_prior::SkillPrior};
use playbot_harness::{game::Game, split::LevelSplit};
use playbot_learner::{DeviceKind, Policy, PolicyFile, Rollout};
use std::{
    collections::BTreeMap,
    io::{self, Read, Write},
    path::Path,
};

/// Finds a game by its name, or says why there is none.
pub type FindGame<'a> = dyn Fn(&str) -> Result<&'a dyn Game, String> + 'a;

/// Plays what a training orders, until `input` ends. `code` names this program's version: a training sends its own, and
/// others are refused, since they may play differently.
///
/// # Errors
///
/// The training is gone, or what it says is no message.
pub fn work(find: &FindGame<'_>, code: &str, input: &mut impl Read, output: &mut impl Write) -> io::Result<()> {
    let mut state: Result<Working<'_>, String> = Err("there is no training yet".to_owned());
    while let Some(Frame { kind, worker, content }) = read_frame(input)? {
        match kind {
            Kind::Setup => state = Working::new(find, code, &content),
            Kind::Weights => {
                if let Ok(working) = &mut state
                    && let Err(why) = working.take_weights(&content)
                {
                    state = Err(why);
                }
            }
            Kind::Play => {
                let order: Order = serde_json::from_slice(&content)?;
                let first = order.first;
                let played = match &mut state {
                    Ok(working) => working.play(order),
                    Err(why) => Err(why.clone()),
                };
                let answer = match played {
                    Ok((answer, rollout)) => answer.with(Some(rollout)),
                    Err(why) => Answer { first, error: Some(why), ..Answer::default() }.with(None),
                };
                write_frame(output, Kind::Played, worker, &[&answer])?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// A worker that knows what to play.
struct Working<'a> {
    game: &'a dyn Game,
    experiment: Experiment,
    weights: Option<(u64, Policy, Option<SkillPrior>)>,
    /// Shares by the numbers of their first agents.
    shares: BTreeMap<u32, Share>,
}

/// A World, and the rollouts that its share has played.
struct Share {
    collector: Collector,
    count: u32,
    levels: LevelSplit,
    played: u64,
}

impl<'a> Working<'a> {
    fn new(find: &FindGame<'a>, code: &str, content: &[u8]) -> Result<Self, String> {
        let setup: Setup = serde_json::from_slice(content).map_err(|error| format!("the training says {error}"))?;
        if (setup.protocol, setup.code.as_str()) != (PROTOCOL, code) {
            return Err(format!(
                "the training runs with {}, and this worker with {code}: use one build on all machines",
                setup.code
            ));
        }
        let experiment = parse_experiment(&setup.experiment, Path::new("the training's experiment"))
            .map_err(|error| error.to_string())?;
        let game = find(&experiment.game)?;
        if game.version() != setup.game_version {
            return Err(format!(
                "the training plays version {} of `{}`, and this worker version {}: use one build on all machines",
                setup.game_version,
                game.name(),
                game.version()
            ));
        }
        Ok(Self { game, experiment, weights: None, shares: BTreeMap::new() })
    }

    fn take_weights(&mut self, content: &[u8]) -> Result<(), String> {
        let (number, bytes) = content.split_first_chunk::<8>().ok_or("the weights are cut off")?;
        let file = PolicyFile::from_bytes(Path::new("the training's policy"), bytes, DeviceKind::default())
            .map_err(|error| error.to_string())?;
        let prior = file.skills.as_ref().map(SkillPrior::from);
        self.weights = Some((u64::from_le_bytes(*number), file.policy, prior));
        Ok(())
    }

    /// Plays a share of a rollout.
    fn play(&mut self, order: Order) -> Result<(Answer, Rollout), String> {
        let Order { first, count, levels, steps, latent, weights, played, plan, states } = order;
        let (policy, prior) = match &self.weights {
            Some((number, policy, prior)) if *number == weights => (policy.clone(), prior.clone()),
            _ => return Err(format!("weights {weights} have not come")),
        };
        if let Some(states) = states {
            let share = self.begin(first, count, levels.clone(), prior.clone())?;
            self.shares.insert(first, Share { played, ..share });
            let collector = self.shares.get_mut(&first).map(|share| &mut share.collector);
            collector
                .map_or(Ok(()), |collector| restore_arenas(collector, &states))
                .map_err(|error| error.to_string())?;
        }
        let agents = self.experiment.arrangement(self.game).total() as usize;
        let share = self.shares.get_mut(&first);
        let share = share.filter(|share| (share.count, &share.levels, share.played) == (count, &levels, played));
        let Some(Share { collector, played, .. }) = share else {
            return Err(format!("the state of agents {first} to {} is not here", first + count - 1));
        };
        let sharing = self.game.tools().host.agents_per_arena() as usize;
        let plan = LevelPlan::new(&self.experiment, agents, sharing).restored(plan);
        if plan.decides() {
            collector.set_queues(&plan.queues()[first as usize..(first + count) as usize]);
        }
        if let Some(prior) = prior {
            collector.world_mut().insert_resource(prior);
        }
        let (rollout, ended) = collector.collect(&policy, latent, steps).map_err(|Fault(why)| why)?;
        *played += 1;
        let states = save_arenas(collector);
        Ok((Answer { first, error: None, ended: ended.into_iter().map(Into::into).collect(), states }, rollout))
    }

    /// Builds the World of a share.
    fn begin(&self, first: u32, count: u32, levels: LevelSplit, prior: Option<SkillPrior>) -> Result<Share, String> {
        let seen = self.experiment.observation_config();
        let mut collector = Collector::new(self.game, &levels, &seen, self.experiment.seed, first, count, prior)
            .map_err(|error| error.to_string())?;
        self.experiment.randomise.install(collector.world_mut());
        Ok(Share { collector, count, levels, played: 0 })
    }
}

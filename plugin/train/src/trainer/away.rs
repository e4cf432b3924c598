//! Worlds of a trainer that play in other processes.

use crate::{
    cluster::{
        ClusterError, Crew, Reply, Traffic,
        wire::{Answer, Order},
    },
    collect::{ArenaState, Ended, save_arenas},
    error::TrainError,
    levels::LevelState,
    trainer::{OfWorld, Trainer},
};
use bevy_playbot::fault::Fault;
use playbot_harness::{game::Game, split::LevelSplit};
use playbot_learner::{
    ActionSpace, LearnError, ObsColumns, ObsKind, Observations, Policy, PolicyFile, PolicyMetadata, Rollout,
    SkillSource,
};
use std::{
    fs,
    ops::Range,
    time::{Duration, Instant},
};

/// Losses of a worker without an answer between them, after which a training ends.
const MOST_LOSSES: u32 = 5;

/// The arenas of a training whose Worlds play elsewhere.
pub(super) struct Away {
    crew: Crew,
    shares: Vec<Share>,
    /// Most agents of a share.
    each: usize,
    /// Rollouts so far, by which weights are numbered.
    rollouts: u64,
    /// Time in which they were played.
    played: Duration,
    game: String,
    action_space: ActionSpace,
    /// A place for the policy, which is sent as a file.
    folder: tempfile::TempDir,
}

/// Neighbouring agents that one World plays.
struct Share {
    first: u32,
    count: u32,
    levels: LevelSplit,
    /// States of the arenas after the last rollout.
    states: Vec<ArenaState>,
    /// Rollouts that it has played.
    played: u64,
    worker: usize,
    /// Whether the worker has these states.
    is_known: bool,
    losses: u32,
}

/// Measurements of a training whose Worlds play elsewhere.
#[derive(Clone, Copy, Debug)]
pub struct ClusterReport {
    /// Number of workers.
    pub workers: usize,
    /// Rollouts.
    pub rollouts: u64,
    /// Bytes on the way.
    pub traffic: Traffic,
    /// Time in which rollouts were played, with all messages.
    pub played: Duration,
}

impl Trainer {
    /// Lets the workers of a crew play from now on. The arenas go on where they are.
    ///
    /// # Errors
    ///
    /// [`ClusterError::Rivals`] in a training against rivals, and a failure to write temporary files.
    pub fn play_away(&mut self, game: &dyn Game, crew: Crew) -> Result<(), TrainError> {
        if self.self_play.is_some() {
            return Err(ClusterError::Rivals.into());
        }
        let states: Vec<ArenaState> = self.collectors.iter_mut().flat_map(save_arenas).collect();
        self.collectors.clear();
        self.later.clear();
        let folder = tempfile::tempdir().map_err(|error| ClusterError::Weights(error.to_string()))?;
        let each = self.experiment.arrangement(game).for_threads(game, crew.workers()).arenas as usize;
        let (game, action_space, played) = (game.name().to_owned(), game.actions(), Duration::ZERO);
        let shares = self.shares_of(states, each, crew.workers());
        self.away = Some(Away { crew, shares, each, rollouts: 0, played, game, action_space, folder });
        Ok(())
    }

    /// Returns measurements of the Worlds that play elsewhere; `None` if none do.
    pub fn cluster_report(&self) -> Option<ClusterReport> {
        let away = self.away.as_ref()?;
        let (workers, traffic) = (away.crew.workers(), away.crew.traffic());
        Some(ClusterReport { workers, rollouts: away.rollouts, traffic, played: away.played })
    }

    /// Splits the agents into shares of at most `each` of the same mode, by the present lesson.
    fn shares_of(&self, states: Vec<ArenaState>, each: usize, workers: usize) -> Vec<Share> {
        let (lesson, _) = self.plan.lesson();
        let (total, mut states) = (states.len(), states.into_iter());
        let parts = (0..total)
            .step_by(each.max(1))
            .flat_map(|first| self.plan.parts_by_mode(first..(first + each).min(total), lesson));
        let share = |(number, (agents, levels)): (usize, (Range<usize>, &LevelSplit))| Share {
            first: agents.start as u32,
            count: agents.len() as u32,
            levels: levels.clone(),
            states: states.by_ref().take(agents.len()).collect(),
            played: 0,
            worker: number % workers.max(1),
            is_known: false,
            losses: 0,
        };
        parts.enumerate().map(share).collect()
    }

    /// Goes on in the modes of the present lesson. Where they are others, episodes that still run are left, and the agents'
    /// random streams go on.
    pub(super) fn change_shares(&mut self) {
        let Some(Away { shares, crew, each, action_space, .. }) = &self.away else { return };
        let left = shares.iter().flat_map(|share| &share.states).map(|state| state.left(action_space));
        let changed = self.shares_of(left.collect(), *each, crew.workers());
        let modes = |shares: &[Share]| -> Vec<(u32, String)> {
            shares.iter().map(|share| (share.first, share.levels.mode.clone())).collect()
        };
        if modes(shares) == modes(&changed) {
            return;
        }
        if let Some(away) = &mut self.away {
            away.shares = changed;
        }
        self.plan.begin_anew();
    }

    /// Plays a rollout elsewhere. The observations of each share go to its columns.
    pub(super) fn collect_away(
        &mut self,
        policy: &Policy,
        latent: usize,
        steps: usize,
        obs: &mut Observations,
    ) -> Result<(Vec<usize>, Vec<OfWorld>), TrainError> {
        let (skills, plan, kind) = (self.learner.skills(), self.plan.state(), self.obs_kind);
        let Some(away) = &mut self.away else { return Ok(Default::default()) };
        let begun = Instant::now();
        let weights = away.weights(policy, skills, &kind)?;
        away.crew.give_weights(away.rollouts, &weights);
        let shares: Vec<usize> = away.shares.iter().map(|share| share.count as usize).collect();
        let orders = Orders { steps, latent, plan };
        (0..shares.len()).for_each(|share| away.ask(share, &orders));
        let mut answers: Vec<Option<OfWorld>> = shares.iter().map(|_| None).collect();
        let mut columns: Vec<_> = obs.columns(&kind, steps, &shares).into_iter().map(Some).collect();
        while answers.iter().any(Option::is_none) {
            match away.crew.next()? {
                Reply::Played(worker, content) => {
                    let wrong = |why| ClusterError::Answer { worker, why };
                    let (answer, rollout) = Answer::read(&content, &kind, &away.action_space, latent).map_err(wrong)?;
                    let place = away.shares.iter().position(|share| share.first == answer.first);
                    let Some((share, columns)) = place.and_then(|place| Some((place, columns[place].take()?))) else {
                        continue;
                    };
                    answers[share] =
                        Some(away.shares[share].take(answer, rollout, steps, columns, &kind).map_err(wrong)?);
                }
                Reply::Lost(worker, why) => {
                    tracing::warn!("worker {worker} was lost, since {why}; another one takes its place");
                    let unanswered = (0..shares.len()).filter(|share| answers[*share].is_none());
                    away.ask_again(worker, &why, unanswered.collect(), &orders)?;
                }
            }
        }
        away.rollouts += 1;
        away.played += begun.elapsed();
        Ok((shares, answers.into_iter().flatten().collect()))
    }

    /// Returns the states of arenas that play elsewhere.
    pub(super) fn states_away(&self) -> Option<Vec<ArenaState>> {
        let away = self.away.as_ref()?;
        Some(away.shares.iter().flat_map(|share| share.states.iter().cloned()).collect())
    }
}

/// What all orders of a rollout have in common.
struct Orders {
    steps: usize,
    latent: usize,
    plan: Option<LevelState>,
}

impl Away {
    /// Returns the bytes of a policy file. A reader checks it by one row of zeros.
    fn weights(&self, policy: &Policy, skills: Option<SkillSource>, kind: &ObsKind) -> Result<Vec<u8>, ClusterError> {
        let path = self.folder.path().join("weights");
        let metadata = PolicyMetadata { game: self.game.clone(), ..PolicyMetadata::default() };
        let file = PolicyFile { metadata, policy: policy.clone(), skills };
        let saved = file.save(&path, &Observations::zeros(kind, 1), &vec![0.0; policy.latent()], 1);
        saved.map_err(|error| ClusterError::Weights(error.to_string()))?;
        fs::read(&path).map_err(|error| ClusterError::Weights(error.to_string()))
    }

    fn ask(&mut self, share: usize, orders: &Orders) {
        let share = &self.shares[share];
        let order = Order {
            first: share.first,
            count: share.count,
            levels: share.levels.clone(),
            steps: orders.steps,
            latent: orders.latent,
            weights: self.rollouts,
            played: share.played,
            plan: orders.plan.clone(),
            states: (!share.is_known).then(|| share.states.clone()),
        };
        // Numbers and texts are always JSON.
        let order = serde_json::to_vec(&order).unwrap_or_default();
        self.crew.ask(share.worker, &order);
    }

    /// Orders a worker's unanswered shares again, from its replacement. All its shares have to be brought there.
    fn ask_again(
        &mut self,
        worker: usize,
        why: &str,
        unanswered: Vec<usize>,
        orders: &Orders,
    ) -> Result<(), ClusterError> {
        self.shares.iter_mut().filter(|share| share.worker == worker).for_each(|share| share.is_known = false);
        for share in unanswered {
            let Share { worker: own, losses, .. } = &mut self.shares[share];
            if *own != worker {
                continue;
            }
            *losses += 1;
            if *losses >= MOST_LOSSES {
                return Err(ClusterError::Lost { worker, times: *losses, why: why.to_owned() });
            }
            self.ask(share, orders);
        }
        Ok(())
    }
}

impl Share {
    /// Takes an answer, whose observations go to `columns`. A fault of the game is an answer, too.
    fn take(
        &mut self,
        answer: Answer,
        mut rollout: Rollout,
        steps: usize,
        mut columns: ObsColumns<'_>,
        kind: &ObsKind,
    ) -> Result<OfWorld, String> {
        if let Some(why) = answer.error {
            return Ok(Err(Fault(why)));
        }
        let (count, width) = (self.count as usize, kind.numbers());
        if (rollout.steps, answer.states.len()) != (steps, count) {
            return Err(format!("it has played {} ticks of {} agents", rollout.steps, answer.states.len()));
        }
        let seen = std::mem::replace(&mut rollout.obs, Observations::empty(kind));
        let fill = |tick: usize| columns.fill_next(seen.rows(tick * count..(tick + 1) * count, width));
        (0..steps).try_for_each(fill).map_err(|error: LearnError| error.to_string())?;
        (self.states, self.is_known, self.losses) = (answer.states, true, 0);
        self.played += 1;
        Ok(Ok((rollout, answer.ended.into_iter().map(Ended::from).collect())))
    }
}

//! Played episodes as evidence: what players observe, do and earn in each tick, and what forced actions change.

use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionValue},
    agent::{AgentOrder, Control},
    demo::{file::DemoEpisode, recorder, replay::Replay},
    engine::{Renewal, TickSchedules, tick_world},
    episode::{Episode, EpisodeEnd},
    fault::Fault,
    legal::{DecisionPeriod, LegalActions},
    level::LevelQueue,
    observation::Observation,
    reward::Reward,
    state_hash::StateHash,
    streams::AgentStreams,
    systems::PlaybotSystems,
    vision::ObservationConfig,
};
use playbot_harness::{
    eval::Player,
    game::{Game, idle_action},
    single_actions::{SingleAction, single_actions},
    worlds::{at_most, build_observing_world, build_world, hash_with_agent},
};
use std::{collections::BTreeMap, sync::Arc};

/// Most values of a vector that are kept.
const MOST_VALUES: usize = 4096;

/// Most values of a picture that are kept.
const MOST_PIXELS: usize = 256;

/// Most arenas that play at the same time.
const ARENAS: usize = 8;

/// Who played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seat {
    /// Uniformly random actions.
    Random,
    /// Random actions, each held for a while.
    Chaos,
    /// The idle action in every tick.
    Idle,
    /// The game's demonstrator.
    Demonstrator,
    /// The policy of the run, on training levels.
    Policy,
    /// The decoder that the policy began as, with skills of the prior, on training levels.
    Decoder,
    /// The policy of the run with skills by chance, on training levels.
    AnySkill,
    /// The policy of the run, on held-out levels.
    HeldOut,
}

impl Seat {
    /// Returns its name in evidence.
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random actions",
            Self::Chaos => "chaos",
            Self::Idle => "doing nothing",
            Self::Demonstrator => "the demonstrator",
            Self::Policy => "the policy",
            Self::Decoder => "its decoder",
            Self::AnySkill => "the policy with skills by chance",
            Self::HeldOut => "the policy on held-out levels",
        }
    }
}

/// One episode, or the beginning of one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlayedEpisode {
    /// Its level.
    pub level: u64,
    /// Values of one observation.
    pub width: usize,
    /// The observation before each action, `[ticks, width]`.
    pub observations: Vec<f32>,
    /// The action of each tick.
    pub actions: Vec<ActionValue>,
    /// The reward of each tick.
    pub rewards: Vec<f32>,
    /// The mask of each tick; empty for an agent without masks.
    pub masks: Vec<Vec<bool>>,
    /// Its end; `None` if it was not played to its end.
    pub end: Option<EpisodeEnd>,
    /// True if the goal was reached.
    pub success: bool,
    /// The full state after each tick, as far as the game says it: the agent's position, and the numbers of a trace.
    /// Replays alone have it.
    pub states: Vec<Vec<f32>>,
}

impl PlayedEpisode {
    /// Returns its ticks.
    pub fn ticks(&self) -> usize {
        self.rewards.len()
    }

    /// Returns the sum of its rewards.
    pub fn total(&self) -> f64 {
        self.earned_until(usize::MAX)
    }

    /// Returns the sum of its rewards in its first ticks.
    pub fn earned_until(&self, ticks: usize) -> f64 {
        self.rewards.iter().take(ticks).map(|reward| f64::from(*reward)).sum()
    }

    /// Returns the tick, from 1, of its first positive reward.
    pub fn first_reward(&self) -> Option<usize> {
        self.rewards.iter().position(|reward| *reward > 0.0).map(|tick| tick + 1)
    }

    /// Iterates over its observations.
    pub fn rows(&self) -> impl Iterator<Item = &[f32]> {
        self.observations.chunks(self.width.max(1))
    }
}

/// The episodes of one player.
#[derive(Clone, Debug, PartialEq)]
pub struct Played {
    /// The player.
    pub seat: Seat,
    /// Its episodes, in the order of their ends.
    pub episodes: Vec<PlayedEpisode>,
    /// The game's breach of contract that ended play.
    pub fault: Option<String>,
}

impl Played {
    /// Iterates over the episodes that were played to their end.
    pub fn ended(&self) -> impl Iterator<Item = &PlayedEpisode> {
        self.episodes.iter().filter(|episode| episode.end.is_some())
    }

    /// Returns the share of ended episodes that reached the goal; `None` without any.
    pub fn success(&self) -> Option<f64> {
        mean(self.ended().map(|episode| f64::from(u8::from(episode.success))))
    }

    /// Returns the mean return of the ended episodes, or of all if none ended.
    pub fn mean_return(&self) -> Option<f64> {
        mean(self.ended().map(PlayedEpisode::total)).or_else(|| mean(self.episodes.iter().map(PlayedEpisode::total)))
    }
}

/// Returns the mean; `None` without values.
pub fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// Returns the middle value; `None` without values.
pub fn median(mut values: Vec<usize>) -> Option<usize> {
    values.sort_unstable();
    values.get(values.len() / 2).copied()
}

/// The plan of a play.
#[derive(Clone, Debug)]
pub struct PlayPlan {
    /// Mode of the game.
    pub mode: String,
    /// Levels, each played once.
    pub levels: Vec<u64>,
    /// Observations of the agents.
    pub observation: ObservationConfig,
    /// Random seed of the players.
    pub seed: u64,
    /// Most ticks of all agents together.
    pub ticks: usize,
}

/// Episodes that agents play now, by their place in the order of agents, and those that ended.
#[derive(Default)]
struct Watched {
    running: BTreeMap<usize, PlayedEpisode>,
    done: Vec<PlayedEpisode>,
    ticks: usize,
}

#[derive(Resource, Reflect, Default)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
struct Watching {
    #[reflect(ignore)]
    watched: Watched,
}

/// Makes a World note every tick of its agents.
fn watch(world: &mut World) {
    Renewal::set_up(world, |world| {
        let judge = world.resource::<TickSchedules>().judge;
        world.schedule_scope(judge, |_, schedule| {
            schedule.add_systems(note.in_set(PlaybotSystems::Record).after(recorder::record_ticks));
        });
    });
    Renewal::carry_resource::<Watching>(world);
    world.init_resource::<Watching>();
}

fn note(world: &mut World) {
    let entities = world.resource::<AgentOrder>().entities().to_vec();
    world.resource_scope(|world, mut watching: Mut<Watching>| {
        let watched = &mut watching.watched;
        for (row, &entity) in entities.iter().enumerate() {
            let parts = (
                world.get::<Control>(entity),
                world.get::<Episode>(entity),
                world.get::<Action>(entity),
                world.get::<Reward>(entity),
            );
            let (Some(control), Some(episode), Some(action), Some(reward)) = parts else { continue };
            if !control.is_active() || !(episode.is_running() || episode.end().is_some()) {
                continue;
            }
            let running = watched.running.entry(row).or_default();
            if episode.tick <= 1 {
                *running = PlayedEpisode { level: episode.level, ..PlayedEpisode::default() };
            }
            let seen = world.get::<Observation>(entity).map(thinned).unwrap_or_default();
            running.width = seen.len();
            running.observations.extend(seen);
            running.actions.push(action.0.clone());
            running.rewards.push(reward.get());
            if let Some(legal) = world.get::<LegalActions>(entity) {
                // Where an earlier decision holds, the mask says nothing about the game.
                let decides =
                    world.get::<DecisionPeriod>(entity).is_none_or(|period| period.decides_in(episode.tick - 1));
                running.masks.push(if decides { legal.mask().to_vec() } else { Vec::new() });
            }
            watched.ticks += 1;
            if episode.end().is_some() {
                (running.end, running.success) = (episode.end(), episode.is_success());
                let ended = std::mem::take(running);
                watched.done.push(ended);
                watched.running.remove(&row);
            }
        }
    });
}

/// Returns the values of an observation, thinned out if there are too many.
fn thinned(observation: &Observation) -> Vec<f32> {
    let step = |count: usize, most: usize| count.div_ceil(most).max(1);
    let (vector, image) = (&observation.vector, &observation.image);
    if vector.is_empty() {
        return image.iter().step_by(step(image.len(), MOST_PIXELS)).map(|&byte| f32::from(byte) / 255.0).collect();
    }
    vector.iter().step_by(step(vector.len(), MOST_VALUES)).copied().collect()
}

/// Plays each level of a plan once, until it is done or its ticks are used up. A fault of the game ends it.
pub fn play(game: &dyn Game, seat: Seat, player: &Player, plan: &PlayPlan) -> Played {
    let failed = |fault: String| Played { seat, episodes: Vec::new(), fault: Some(fault) };
    let count = at_most(game, plan.levels.len().min(ARENAS)).max(1);
    let built = build_observing_world(game, &plan.mode, &plan.observation, plan.seed, 0, count as u32);
    let (mut world, agents) = match built {
        Ok(built) => built,
        Err(error) => return failed(error.to_string()),
    };
    watch(&mut world);
    player.install(&mut world);
    for (row, &agent) in agents.iter().enumerate() {
        let levels: Vec<u64> = plan.levels.iter().skip(row).step_by(count).copied().collect();
        let control = player.seat(game, &mut world, agent);
        let streams = AgentStreams::new(plan.seed, row as u32);
        world.entity_mut(agent).insert((streams, control, LevelQueue::list(levels)));
    }
    let mut fault = None;
    loop {
        if let Err(error) = tick_world(&mut world) {
            fault = Some(error.to_string());
            break;
        }
        let is_over = agents.iter().all(|&agent| !Control::of(&world, agent).is_active());
        if is_over || world.resource::<Watching>().watched.ticks >= plan.ticks {
            break;
        }
    }
    let watched = world.remove_resource::<Watching>().map(|watching| watching.watched).unwrap_or_default();
    let left = watched.running.into_values().filter(|episode| episode.ticks() > 0);
    Played { seat, episodes: watched.done.into_iter().chain(left).collect(), fault }
}

/// One replayed recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Replayed {
    /// What happened.
    pub episode: PlayedEpisode,
    /// The first difference to the recording.
    pub divergence: Option<String>,
}

/// Replays recorded episodes of one mode, up to the first difference each. The rewards are those of the present rules.
///
/// # Errors
///
/// The game's breach of contract, in words.
pub fn replay(
    game: &dyn Game,
    mode: &str,
    observation: &ObservationConfig,
    episodes: &[Arc<DemoEpisode>],
) -> Result<Vec<Replayed>, String> {
    let built = build_observing_world(game, mode, observation, 0, 0, 1);
    let (mut world, agents) = built.map_err(|error| error.to_string())?;
    watch(&mut world);
    let agent = agents[0];
    let mut replayed = Vec::new();
    for recorded in episodes.iter().filter(|episode| !episode.is_empty()) {
        world.insert_resource(Watching::default());
        Replay::new(recorded.clone()).paid_anew().start(&mut world.entity_mut(agent));
        let mut states = Vec::new();
        let divergence = loop {
            tick_world(&mut world).map_err(|fault| fault.to_string())?;
            states.push(full_state(game, &world, agent));
            let Some(replay) = world.get::<Replay>(agent) else { continue };
            if let Some(divergence) = replay.divergence() {
                break Some(divergence.to_string());
            }
            if replay.is_finished() {
                break None;
            }
        };
        let watched = std::mem::take(&mut world.resource_mut::<Watching>().watched);
        let episode = watched.done.into_iter().next().or_else(|| watched.running.into_values().next());
        replayed.push(Replayed { episode: PlayedEpisode { states, ..episode.unwrap_or_default() }, divergence });
    }
    Ok(replayed)
}

/// Returns the state of an agent as far as the game says it.
fn full_state(game: &dyn Game, world: &World, agent: Entity) -> Vec<f32> {
    let tools = game.tools();
    let position = tools.state.position(world, agent).into_iter().flat_map(|at| [at.x, at.y]);
    let traced = if tools.trace.columns().is_some() { tools.trace.row(world, agent) } else { Vec::new() };
    position.chain(traced).filter(|value| value.is_finite()).collect()
}

// Forced actions: what each action changes, against doing nothing, in copies of a World.

/// Moments of an episode in which actions are tried, and ticks for which each is held.
const MOMENTS: usize = 3;
const HELD: usize = 10;

/// Longest beginning of an episode that is played for a moment, ticks.
const LATEST: usize = 120;

/// An action that was forced.
#[derive(Clone, Debug, PartialEq)]
pub struct ForcedAction {
    /// Its name.
    pub name: String,
    /// The number of a discrete action, or its place among the options of all choices and then the numbers.
    pub number: u32,
    /// Moments in which it was tried.
    pub tried: usize,
    /// Moments in which it changed something.
    pub effects: usize,
}

impl ForcedAction {
    /// Returns whether it was tried in several moments and never changed anything.
    pub fn is_dead(&self) -> bool {
        self.tried >= 2 && self.effects == 0
    }
}

/// Tries every action but the idle ones, from a few moments of an episode on, unless it has an effect in `forced` already,
/// and adds the results there. A continuous value is tried far up and far down.
///
/// # Errors
///
/// The game broke its contract.
pub fn force(
    game: &dyn Game,
    mode: &str,
    episode: &PlayedEpisode,
    forced: &mut Vec<ForcedAction>,
) -> Result<(), Fault> {
    let (idle, candidates) = (idle_action(game), candidates(game));
    if forced.is_empty() {
        let untried = |(name, number, _): &(String, u32, _)| ForcedAction {
            name: name.clone(),
            number: *number,
            tried: 0,
            effects: 0,
        };
        forced.extend(candidates.iter().map(untried));
    }
    if forced.iter().all(|action| action.effects > 0) {
        return Ok(());
    }
    let length = episode.actions.len().min(LATEST);
    let mut moments: Vec<usize> = (0..MOMENTS).map(|moment| length * moment / MOMENTS).collect();
    moments.dedup();
    for moment in moments {
        let before = &episode.actions[..moment];
        let nothing = held(game, mode, episode.level, before, &idle)?;
        for (action, (.., ways)) in forced.iter_mut().zip(&candidates).filter(|(action, _)| action.effects == 0) {
            // A masked action would not be played.
            let mask = episode.masks.get(moment);
            let is_legal = mask.is_none_or(|mask| mask.get(action.number as usize).copied().unwrap_or(true));
            if !is_legal {
                continue;
            }
            action.tried += 1;
            for way in ways {
                if held(game, mode, episode.level, before, way)? != nothing {
                    action.effects += 1;
                    break;
                }
            }
        }
    }
    Ok(())
}

/// Returns the actions to try: name, number, and the ways to take each.
fn candidates(game: &dyn Game) -> Vec<(String, u32, Vec<ActionValue>)> {
    let doing = single_actions(game).into_iter().filter(|single| !single.is_idle);
    let named =
        |SingleAction { name, number, ways, .. }| (name.unwrap_or_else(|| format!("action {number}")), number, ways);
    doing.map(named).collect()
}

/// Returns the hashes of the ticks in which an action is held, after the beginning of an episode.
fn held(
    game: &dyn Game,
    mode: &str,
    level: u64,
    before: &[ActionValue],
    action: &ActionValue,
) -> Result<Vec<u64>, Fault> {
    let (mut world, agents) = build_world(game, mode, 0, 0, 1);
    let agent = agents[0];
    world.entity_mut(agent).insert((Control::Replay, LevelQueue::Always(level)));
    let mut hashes = Vec::new();
    let all = before.iter().chain(std::iter::repeat_n(action, HELD));
    for (tick, action) in all.enumerate() {
        world.entity_mut(agent).insert(Action(action.clone()));
        tick_world(&mut world)?;
        if tick >= before.len() {
            let state = world.get::<StateHash>(agent).map_or(0, |hash| hash.0);
            hashes.push(hash_with_agent(state, world.get::<Observation>(agent), world.get::<Reward>(agent)));
        }
    }
    Ok(hashes)
}

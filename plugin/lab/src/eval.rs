//! Evaluation: each level equally often, every episode counted once.

use std::collections::HashMap;

use bevy::prelude::*;
use playbot_learner::{HasExitCode, Policy, PolicyFile};
use thiserror::Error;

mod blind;
mod summary;

pub use bevy_playbot::episode::EpisodeResult;
pub use blind::{CHAOS, blind_bots};
pub use summary::{EvalSummary, error_over_levels, summarize};

use crate::{
    arrangement::Arrangement,
    ended_episodes::EndedEpisodes,
    game::Game,
    machine::{MemoryError, check_bytes},
    parallel::on_threads,
    split::LevelSplit,
    worlds::build_observing_world,
};
use bevy_playbot::{
    agent::Agent,
    bot::BlindBot,
    control::Control,
    episode::Episode,
    fault::Fault,
    headless::tick_world,
    level::LevelQueue,
    policy::{ActionDraw, ActivePolicy},
    skill_prior::SkillPrior,
    vision::{ObservationConfig, VisionError},
};

/// The player that is evaluated.
#[derive(Clone)]
#[allow(clippy::large_enum_variant, reason = "one per measurement")]
pub enum Player {
    /// A learned policy, with its skills if it has any.
    Policy {
        /// The policy.
        policy: Policy,
        /// The source of its skills.
        prior: Option<SkillPrior>,
        /// How actions are drawn.
        draw: ActionDraw,
    },
    /// A bot without sensors.
    Blind(BlindBot),
    /// The game's own demonstrator, without noise.
    Demonstrator,
}

/// The reason why an evaluation failed.
#[derive(Debug, Error)]
pub enum EvalError {
    /// The pictures cannot be drawn.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The results of the episodes do not fit into memory.
    #[error(transparent)]
    Memory(#[from] MemoryError),
}

impl HasExitCode for EvalError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Fault(_) => 2,
            Self::Vision(_) | Self::Memory(_) => 3,
        }
    }
}

impl Player {
    /// Creates a player from the policy of a file, with its skills.
    pub fn of_file(file: &PolicyFile, draw: ActionDraw) -> Self {
        Self::Policy { policy: file.policy.clone(), prior: file.skills.as_ref().map(SkillPrior::from), draw }
    }

    /// Installs the player's networks and its source of skills in a World, once.
    pub fn install(&self, world: &mut World) {
        if let Self::Policy { policy, prior, draw } = self {
            ActivePolicy { policy: policy.clone(), draw: *draw }.install(world, prior.clone());
        }
    }

    /// Prepares an agent for the player, and returns the control under which the player decides for it.
    pub fn seat(&self, game: &dyn Game, world: &mut World, agent: Entity) -> Control {
        match self {
            Self::Policy { .. } => Control::Policy,
            Self::Blind(bot) => {
                world.entity_mut(agent).insert(bot.clone());
                Control::Bot
            }
            Self::Demonstrator => {
                game.tools().bots.attach_demonstrator(world, agent, 0.0);
                Control::Bot
            }
        }
    }
}

/// The settings of an evaluation.
#[derive(Clone, Debug)]
pub struct EvalPlan {
    /// Levels.
    pub split: LevelSplit,
    /// The observation of a learned policy. Bots have vectors, which are cheaper.
    pub observation_config: ObservationConfig,
    /// Episodes on each level.
    pub episodes_per_level: u32,
    /// Random seed of the players.
    pub seed: u64,
    /// Arenas, spread evenly over the Worlds.
    pub arenas: u32,
    /// Worlds. Their number is part of the plan, as in training.
    pub worlds: u32,
    /// Threads. They change no result.
    pub threads: usize,
}

impl EvalPlan {
    /// Checks that the Worlds and the results of all episodes fit into free memory.
    ///
    /// # Errors
    ///
    /// [`MemoryError`].
    pub fn check_memory(&self) -> Result<(), MemoryError> {
        let (levels, episodes) = (self.split.len(), u64::from(self.episodes_per_level));
        // The result of each episode, and its number in the list of those to play.
        let bytes = levels.saturating_mul(episodes).saturating_mul((size_of::<Trail>() + size_of::<u64>()) as u64);
        let what = format!("the results of {levels} levels × {episodes} episodes");
        let worlds = Arrangement { worlds: self.worlds, arenas: self.arenas / self.worlds.max(1) };
        check_bytes(what, bytes, "the number of levels, or `eval.episodes_per_level`", worlds)
    }
}

/// An evaluated episode with its path.
#[derive(Clone, Debug, PartialEq)]
pub struct Trail {
    /// The episode.
    pub result: EpisodeResult,
    /// Position of the agent after each tick, on the game's [`FloorPlan`](crate::floor_plan::FloorPlan). Empty if the
    /// game does not report it.
    pub places: Vec<Vec2>,
}

/// Plays every level of the plan and returns all episodes, sorted by level. `progress` receives each finished episode,
/// from several threads.
///
/// # Errors
///
/// The game broke its contract, or cannot be observed this way.
pub fn evaluate(
    game: &dyn Game,
    player: &Player,
    plan: &EvalPlan,
    progress: impl Fn(u64) + Sync,
) -> Result<Vec<EpisodeResult>, EvalError> {
    let trails = play(game, player, plan, false, progress)?;
    Ok(trails.into_iter().map(|trail| trail.result).collect())
}

/// Evaluates as [`evaluate`] does, and also returns the path of every episode. The results are the same.
///
/// # Errors
///
/// The game broke its contract, or cannot be observed this way.
pub fn evaluate_with_trails(
    game: &dyn Game,
    player: &Player,
    plan: &EvalPlan,
    progress: impl Fn(u64) + Sync,
) -> Result<Vec<Trail>, EvalError> {
    play(game, player, plan, true, progress)
}

fn play(
    game: &dyn Game,
    player: &Player,
    plan: &EvalPlan,
    follow: bool,
    progress: impl Fn(u64) + Sync,
) -> Result<Vec<Trail>, EvalError> {
    if let Some(problem) = game.problem() {
        return Err(Fault(problem).into());
    }
    plan.check_memory()?;
    let arrangement = Arrangement::new(game, plan.arenas, plan.worlds);
    let worlds: Result<Vec<_>, _> =
        arrangement.first_agents().map(|first| build_eval_world(game, player, plan, arrangement, first)).collect();
    let mut worlds = worlds?;
    let followed = follow.then_some(game);
    let parts = on_threads(&mut worlds, plan.threads, |world| play_out(world, followed, &progress));
    let mut trails = Vec::new();
    for part in parts {
        trails.extend(part?);
    }
    trails.sort_by_key(|trail| trail.result.level);
    Ok(trails)
}

/// Builds a World whose agents hold their share of the plan: agent i plays the i-th episode of every round.
fn build_eval_world(
    game: &dyn Game,
    player: &Player,
    plan: &EvalPlan,
    arrangement: Arrangement,
    first: u32,
) -> Result<World, VisionError> {
    let (per_world, total) = (arrangement.arenas, arrangement.total() as usize);
    let observation_config =
        if matches!(player, Player::Policy { .. }) { plan.observation_config } else { ObservationConfig::default() };
    let (mut world, agents) =
        build_observing_world(game, &plan.split.mode, &observation_config, plan.seed, first, per_world)?;
    EndedEpisodes::note_in(&mut world);
    let all: Vec<u64> = (0..plan.episodes_per_level).flat_map(|_| plan.split.levels()).collect();
    for (offset, &agent) in agents.iter().enumerate() {
        let levels: Vec<u64> = all.iter().skip(first as usize + offset).step_by(total).copied().collect();
        world.entity_mut(agent).insert(LevelQueue::list(levels));
        let control = player.seat(game, &mut world, agent);
        world.entity_mut(agent).insert(control);
    }
    player.install(&mut world);
    Ok(world)
}

/// Ticks until every agent has played its list. With a game, stores the position of each agent after each tick.
fn play_out(
    world: &mut World,
    followed: Option<&dyn Game>,
    progress: &(impl Fn(u64) + Sync),
) -> Result<Vec<Trail>, Fault> {
    let everybody = world.query_filtered::<Entity, With<Agent>>().iter(world).collect::<Vec<_>>();
    let mut places: HashMap<Entity, Vec<Vec2>> = HashMap::new();
    let mut trails = Vec::new();
    while everybody.iter().any(|&agent| Control::of(world, agent).is_active()) {
        tick_world(world)?;
        let ended = EndedEpisodes::take(world);
        for (game, &agent) in followed.iter().flat_map(|game| everybody.iter().map(move |agent| (game, agent))) {
            let is_playing = world.get::<Episode>(agent).is_some_and(Episode::is_running);
            let is_seen = is_playing || ended.iter().any(|(entity, _)| *entity == agent);
            if let Some(place) = is_seen.then(|| game.tools().state.position(world, agent)).flatten() {
                places.entry(agent).or_default().push(place);
            }
        }
        if !ended.is_empty() {
            progress(ended.len() as u64);
        }
        let trail = |(agent, result)| Trail { result, places: places.remove(&agent).unwrap_or_default() };
        trails.extend(ended.into_iter().map(trail));
    }
    Ok(trails)
}

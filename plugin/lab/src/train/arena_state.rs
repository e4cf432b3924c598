//! Saved arenas in the middle of their episodes.
//!
//! Games do not store their state: they are deterministic, so level and past actions restore it.

use bevy::prelude::*;
use playbot_learner::{Actions, RngState};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::collect::{ActionLog, Collector};
use bevy_playbot::{
    action::{ActionSpace, ActionValue},
    agent::Agent,
    control::Control,
    episode::Episode,
    fault::Fault,
    headless::tick_world,
    level::LevelQueue,
    skill_prior::ActiveSkill,
    state_hash::StateHash,
    streams::AgentStreams,
};

/// Saved state of one arena.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArenaState {
    /// Level of the current episode; `None` between two episodes.
    level: Option<u64>,
    actions: Actions,
    state_hash: u64,
    skill: Vec<f32>,
    skill_ticks_left: u32,
    streams: [RngState; 3],
}

/// Failure to restore an arena.
#[derive(Debug, Error)]
pub enum RestoreError {
    /// The game broke its contract while the arenas were replayed.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The replayed arena differs from the saved one.
    #[error(
        "arena {0} did not replay to its saved state: the game's rules have changed since the checkpoint, or the game keeps \
         state from one episode to the next. Look for resources that a restart does not reset, elapsed time (`Time`), a \
         `Local` of a system, a `static`, a random generator that is not seeded from the level, or the order of stored \
         entities. `playbot doctor` names such state. In a `Local`, a `static`, an asset, a type without `Reflect` or a \
         field with `#[reflect(ignore)]`, it sees only the effects on agents. If a foreign game cannot reset its state, use \
         `Restart::Rebuild`, which builds a new World for each episode"
    )]
    Diverged(usize),
    /// The checkpoint has another number of arenas.
    #[error("the checkpoint has {saved} arenas, the experiment {wanted}")]
    Count {
        /// Arenas in the checkpoint.
        saved: usize,
        /// Arenas of the experiment.
        wanted: usize,
    },
    /// Unreadable generator state, or an action outside the game's space.
    #[error(transparent)]
    Stream(#[from] playbot_learner::LearnError),
}

/// Reads the state of every arena, in the order of the agents.
pub fn save_arenas(collector: &mut Collector) -> Vec<ArenaState> {
    let agents = collector.agents().to_vec();
    let world = collector.world_mut();
    let mut query = world.query::<(&Agent, &Episode, &ActionLog, &ActiveSkill, &AgentStreams, &StateHash)>();
    agents
        .iter()
        .filter_map(|&agent| query.get(world, agent).ok())
        .map(|(agent, episode, log, skill, streams, hash)| ArenaState {
            level: episode.is_running().then_some(episode.level),
            actions: collect_actions(&agent.actions, &log.0),
            state_hash: hash.0,
            skill: skill.z.clone(),
            skill_ticks_left: skill.ticks_left,
            streams: [&streams.level, &streams.action, &streams.skill].map(RngState::of),
        })
        .collect()
}

fn collect_actions(space: &ActionSpace, log: &[ActionValue]) -> Actions {
    let mut actions = Actions::empty(space);
    for action in log {
        // The log holds the agent's action, which was checked against its space.
        if let Err(error) = actions.push(action) {
            tracing::error!("an action is missing from the checkpoint: {error}");
        }
    }
    actions
}

/// Brings every arena of a fresh collector to its saved state.
///
/// # Errors
///
/// [`RestoreError`] if the arenas differ in number or do not replay.
pub fn restore_arenas(collector: &mut Collector, saved: &[ArenaState]) -> Result<(), RestoreError> {
    let agents = collector.agents().to_vec();
    if agents.len() != saved.len() {
        return Err(RestoreError::Count { saved: saved.len(), wanted: agents.len() });
    }
    let world = collector.world_mut();
    for (&agent, state) in agents.iter().zip(saved) {
        if let Some(agent) = world.get::<Agent>(agent) {
            // A game gets only actions of its own space, even from a damaged file.
            agent.actions.check(&state.actions)?;
        }
    }
    let queues: Vec<_> = agents.iter().map(|&agent| world.get::<LevelQueue>(agent).cloned()).collect();
    for (&agent, state) in agents.iter().zip(saved) {
        let control = if state.level.is_some() { Control::Replay } else { Control::Idle };
        world.entity_mut(agent).insert((control, LevelQueue::Always(state.level.unwrap_or_default())));
    }
    replay(world, &agents, saved)?;
    for (row, (&agent, state)) in agents.iter().zip(saved).enumerate() {
        let mut entity = world.entity_mut(agent);
        if state.level.is_some() && entity.get::<StateHash>().is_none_or(|hash| hash.0 != state.state_hash) {
            return Err(RestoreError::Diverged(row));
        }
        let [level, action, skill] = &state.streams;
        let streams = AgentStreams::restored(level.restore()?, action.restore()?, skill.restore()?);
        let active = ActiveSkill { z: state.skill.clone(), ticks_left: state.skill_ticks_left };
        let log = ActionLog((0..state.actions.len()).filter_map(|tick| state.actions.get(tick)).collect());
        entity.insert((Control::Policy, streams, active, log));
        if let Some(queue) = &queues[row] {
            entity.insert(queue.clone());
        }
    }
    Ok(())
}

/// Plays the saved actions; arenas at their saved tick stand still.
fn replay(world: &mut World, agents: &[Entity], saved: &[ArenaState]) -> Result<(), Fault> {
    let longest = saved.iter().map(|state| state.actions.len()).max().unwrap_or(0);
    for tick in 0..longest {
        for (&agent, state) in agents.iter().zip(saved) {
            match state.actions.get(tick) {
                Some(action) => world.entity_mut(agent).insert(bevy_playbot::action::Action(action)),
                None => world.entity_mut(agent).insert(Control::Idle),
            };
        }
        tick_world(world)?;
    }
    Ok(())
}

//! Saving arenas in the middle of their episodes.
//!
//! A game is not asked to store its state: since it is deterministic, the level and the actions so far bring it back.

use bevy::prelude::*;
use playbot_learner::{Actions, RngState};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::collect::Collector;
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

/// Actions of the running episode.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct ActionLog(Vec<ActionValue>);

impl ActionLog {
    /// Notes the action of this tick; the log is empty again after the last tick of an episode.
    pub(crate) fn note(&mut self, episode: &Episode, action: &ActionValue) {
        if episode.tick <= 1 || episode.end().is_some() {
            self.0.clear();
        }
        if episode.end().is_none() {
            self.0.push(action.clone());
        }
    }
}

/// What brings one arena back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArenaState {
    /// Level of the running episode; `None` between two episodes.
    level: Option<u64>,
    actions: Actions,
    state_hash: u64,
    skill: Vec<f32>,
    skill_ticks_left: u32,
    streams: [RngState; 3],
}

/// An arena could not be brought back.
#[derive(Debug, Error)]
pub enum RestoreError {
    /// The game broke its contract while the arenas were replayed.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The replayed arena is not the saved one.
    #[error(
        "arena {0} did not replay to its saved state: the checkpoint was made with other rules of the game, or the game \
         keeps something that a new World does not have: resources that a restart does not reset, the time that has passed \
         (`Time`), a `Local` of a system, a `static`, a random generator that is not seeded from the level, or the order in \
         which entities are stored; `playbot doctor` names it, unless it hides in a `Local`, a `static`, an asset, a type \
         that does not derive `Reflect` or a field with `#[reflect(ignore)]`: of those it sees only what agents notice. \
         For what a foreign game cannot set back there is `Restart::Rebuild`, which builds the World anew for each episode"
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
    /// A generator state cannot be read, or an action is none of the game's.
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
        // The log holds what the agent did, and that was checked against its space.
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
            // A game is promised actions of its own space, whatever a file says.
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

/// Plays the saved actions; an arena that has reached its tick stands still.
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

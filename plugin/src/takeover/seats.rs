//! Former players of agents, so that the controls can be given back.

use bevy::prelude::*;

use crate::{
    agent::AgentOrder, control::Control, episode::Episode, level::LevelQueue, skill_prior::ActiveSkill,
    streams::AgentStreams,
};

/// The state of an agent before a takeover.
#[derive(Clone, Debug)]
pub(super) struct Seat {
    pub agent: Entity,
    control: Control,
    levels: LevelQueue,
    streams: AgentStreams,
}

/// Returns the agents that are played, lowest number first.
pub(super) fn playing_agents(world: &World) -> Vec<Entity> {
    let agents = world.resource::<AgentOrder>().entities().iter().copied();
    agents.filter(|&agent| Control::of(world, agent).is_active()).collect()
}

impl Seat {
    /// Notes the player of an agent.
    pub fn of(world: &World, agent: Entity) -> Option<Self> {
        let control = *world.get::<Control>(agent)?;
        let (levels, streams) = (world.get::<LevelQueue>(agent)?.clone(), world.get::<AgentStreams>(agent)?.clone());
        Some(Self { agent, control, levels, streams })
    }

    /// Gives the seat back in the middle of the episode.
    pub fn give_back(self, world: &mut World) {
        if let Ok(mut agent) = world.get_entity_mut(self.agent) {
            agent.insert(self.control);
        }
    }

    /// Gives the seat back with a new episode: the former player did not play the last one.
    pub fn give_back_anew(self, world: &mut World) {
        let Ok(mut agent) = world.get_entity_mut(self.agent) else { return };
        if let Some(mut episode) = agent.get_mut::<Episode>() {
            episode.abandon();
        }
        agent.insert((self.control, self.levels, self.streams));
    }
}

/// Resets a skill: one that was drawn for another state does not fit this one.
pub(super) fn forget_skill(world: &mut World, agent: Entity) {
    if let Some(mut skill) = world.get_mut::<ActiveSkill>(agent) {
        skill.ticks_left = 0;
    }
}

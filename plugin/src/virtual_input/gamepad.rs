//! Gamepads of the agents that use one.

use bevy::prelude::*;

use super::{component::VirtualInput, messages::InputMessages};
use crate::agent::Agent;

/// The gamepad of an agent. Games see it as one that is plugged in.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component)]
pub struct VirtualGamepad {
    /// The agent.
    pub agent: Entity,
}

/// Plugs in the gamepads of agents that have none yet, and unplugs those whose agents are gone.
///
/// Runs before Bevy's own input systems, which make them gamepads in the same frame.
pub(super) fn connect_gamepads(
    agents: Query<(Entity, &Agent, &VirtualInput)>,
    pads: Query<(Entity, &VirtualGamepad)>,
    mut messages: InputMessages,
    mut commands: Commands,
) {
    for (pad, owner) in &pads {
        if !agents.get(owner.agent).is_ok_and(|(.., input)| input.uses_gamepad()) {
            commands.entity(pad).despawn();
        }
    }
    for (entity, agent, input) in &agents {
        if input.uses_gamepad() && !pads.iter().any(|(_, owner)| owner.agent == entity) {
            let pad = commands.spawn(VirtualGamepad { agent: entity }).id();
            messages.send_connection(pad, format!("gamepad of agent {}", agent.index));
        }
    }
}

//! Who decides for an agent.

use bevy::prelude::*;

/// Who writes the agent's [`Action`](crate::action::Action). May be changed at any tick.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Component)]
pub enum Control {
    /// A person: the game turns input into actions.
    Human,
    /// A script: a [`BlindBot`](crate::bot::BlindBot) or a system of the game.
    Bot,
    /// The [`ActivePolicy`](crate::policy::ActivePolicy).
    Policy,
    /// A recording: [`Replay`](crate::demo::replay::Replay).
    Replay,
    /// Nobody: no episode is started, and a running one stands still. Games leave the arena of an idle agent alone.
    #[default]
    Idle,
}

impl Control {
    /// Who decides for an agent now; [`Idle`](Self::Idle) for an entity that is none.
    pub fn of(world: &World, agent: Entity) -> Self {
        world.get::<Self>(agent).copied().unwrap_or_default()
    }

    /// Whether somebody decides, so that the game goes on.
    pub fn is_active(self) -> bool {
        self != Self::Idle
    }
}

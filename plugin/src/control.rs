//! The source of an agent's actions.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//!
//! let mut app = headless_app();
//! let agent = app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human)).id();
//! app.ticks(3).expect("no agent broke its contract");
//! // A script takes over in the middle of the episode.
//! app.world_mut().entity_mut(agent).insert((Control::Bot, BlindBot::Constant(ActionValue::Discrete(1))));
//! app.ticks(2).expect("no agent broke its contract");
//! assert_eq!(app.world().get::<Action>(agent), Some(&Action(ActionValue::Discrete(1))));
//! assert_eq!(app.world().get::<Episode>(agent).expect("every agent has one").tick, 5);
//! ```

use bevy::prelude::*;

use crate::carry_over::ReflectCarryComponent;

/// The source of the agent's [`Action`](crate::action::Action). May be changed at any tick.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Component, CarryComponent)]
pub enum Control {
    /// A person: the game turns input into actions.
    Human,
    /// A script: a [`BlindBot`](crate::bot::BlindBot) or a system of the game.
    Bot,
    /// The [`ActivePolicy`](crate::policy::ActivePolicy).
    Policy,
    /// A recording: [`Replay`](crate::demo::replay::Replay).
    Replay,
    /// No source: no episode is started, and a running one is paused. Games leave the arena of an
    /// idle agent alone.
    #[default]
    Idle,
}

impl Control {
    /// Returns the current source of an agent's actions, or [`Idle`](Self::Idle) for an entity that
    /// is no agent.
    pub fn of(world: &World, agent: Entity) -> Self {
        world.get::<Self>(agent).copied().unwrap_or_default()
    }

    /// Returns whether there is a source of actions, so that the game goes on.
    pub fn is_active(self) -> bool {
        self != Self::Idle
    }
}

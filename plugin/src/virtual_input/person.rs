//! People whose own keys do not reach the game.

use bevy::prelude::*;

/// Presses keys for the agent under [`Control::Human`](crate::control::Control::Human), too, by its
/// [`Action`](crate::action::Action). For windows that keep a person's own devices from the game and make an action of
/// them: the game then sees exactly what a recording of these actions presses when it is replayed.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
pub struct PressesForPeople;

//! People whose own keys do not reach the game.

use bevy::prelude::*;

/// Presses keys for the agent under [`Control::Human`](crate::control::Control::Human), too, by its
/// [`Action`](crate::action::Action). For windows that keep a person's own devices from the game and turn them into
/// an action: the game then sees exactly the keys that a replay of these actions presses.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
pub struct PressesForPeople;

//! The two ways from an action to the game.

use bevy::prelude::*;

/// The way from an action to the game.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
pub enum InputRoute {
    /// For ticks that are frames: in `PreUpdate`, before [`InputSystems`](bevy::input::InputSystems), messages are sent as a
    /// window would, and Bevy's own systems, input managers and the game do the rest in the same frame.
    Messages,
    /// For fixed ticks: in `FixedPreUpdate` what games read is written at once, so that a game in `FixedUpdate` sees
    /// `just_pressed` in the same tick, and exactly once, however many ticks a frame runs. Systems in `Update` see
    /// everything that happened in the frame.
    ///
    /// Messages are sent in the same tick. Only `RawGamepadEvent` is left out, except for the connection of a gamepad: Bevy's
    /// own system would read it in the next frame and play everything a second time. What a driver says is in
    /// `RawGamepadButtonChangedEvent` and `RawGamepadAxisChangedEvent`; what games usually read, in `GamepadEvent` and its
    /// parts.
    #[default]
    Direct,
}

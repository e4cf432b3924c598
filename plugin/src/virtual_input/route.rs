//! The two routes from an action to the game.

use bevy::prelude::*;

/// The route from an action to the game.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
pub enum InputRoute {
    /// For ticks that are frames. In `PreUpdate`, before [`InputSystems`](bevy::input::InputSystems), messages are
    /// sent as a window would. Bevy's own systems, input managers and the game do the rest in the same frame.
    Messages,
    /// For fixed ticks. In `FixedPreUpdate` the state that games read is written at once. A game in `FixedUpdate`
    /// sees `just_pressed` in the same tick, and exactly once, however many ticks a frame runs. Systems in `Update`
    /// see everything that happened in the frame.
    ///
    /// Messages are sent in the same tick. Only `RawGamepadEvent` is left out, except for the connection of a
    /// gamepad: Bevy's own system would read it in the next frame and play everything a second time. A driver's
    /// values are in `RawGamepadButtonChangedEvent` and `RawGamepadAxisChangedEvent`; most games read `GamepadEvent`
    /// and its parts.
    #[default]
    Direct,
}

//! Inputs with a continuous value.

use bevy::prelude::*;

/// A motion or a stick that takes a number in each tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
pub enum VirtualAxis {
    /// Motion of the mouse to the right, pixels per tick.
    MouseX,
    /// Motion of the mouse downwards, pixels per tick.
    MouseY,
    /// The mouse wheel sideways, lines per tick.
    WheelX,
    /// The mouse wheel, lines per tick.
    WheelY,
    /// A stick of the agent's own gamepad, -1 to 1, held until the next tick.
    Stick(GamepadAxis),
    /// A trigger of the agent's own gamepad, 0 to 1, held until the next tick.
    Trigger(GamepadButton),
}

impl VirtualAxis {
    /// Returns whether it belongs to the gamepad. Every agent has its own.
    pub(super) fn is_gamepad(self) -> bool {
        matches!(self, Self::Stick(_) | Self::Trigger(_))
    }
}

impl From<GamepadAxis> for VirtualAxis {
    fn from(axis: GamepadAxis) -> Self {
        Self::Stick(axis)
    }
}

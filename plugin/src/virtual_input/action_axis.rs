//! From one value of a continuous action to keys and sticks.

use bevy::prelude::*;

use super::{axis::VirtualAxis, button::VirtualButton, held::HeldInput};

/// Default threshold beyond which values press their key.
const THRESHOLD: f32 = 0.5;

/// The effect of one value of a continuous action.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub enum ActionAxis {
    /// Keys or buttons for each sign, pressed while the value lies beyond the threshold.
    Buttons {
        /// Held below `-threshold`.
        negative: Vec<VirtualButton>,
        /// Held above `threshold`.
        positive: Vec<VirtualButton>,
        /// Magnitude that a value must exceed.
        threshold: f32,
    },
    /// A motion or a stick, pushed by the value.
    Analog {
        /// The pushed axis.
        axis: VirtualAxis,
        /// Factor from the value to the axis, such as pixels per tick.
        scale: f32,
    },
}

impl ActionAxis {
    /// Creates an axis with keys or buttons for each sign of the value: left and right, brake and throttle. They are
    /// pressed beyond ±0.5.
    pub fn buttons<N: Into<VirtualButton>, P: Into<VirtualButton>>(
        negative: impl IntoIterator<Item = N>,
        positive: impl IntoIterator<Item = P>,
    ) -> Self {
        Self::Buttons {
            negative: negative.into_iter().map(Into::into).collect(),
            positive: positive.into_iter().map(Into::into).collect(),
            threshold: THRESHOLD,
        }
    }

    /// Keys for each sign of the value.
    pub fn keys(negative: impl IntoIterator<Item = KeyCode>, positive: impl IntoIterator<Item = KeyCode>) -> Self {
        Self::buttons(negative, positive)
    }

    /// Sets another threshold for the keys. Has no effect on sticks and motions.
    pub fn with_threshold(self, threshold: f32) -> Self {
        match self {
            Self::Buttons { negative, positive, .. } => Self::Buttons { negative, positive, threshold },
            analog => analog,
        }
    }

    /// Creates a stick of the gamepad: the value, limited to -1 to 1.
    pub fn stick(axis: GamepadAxis) -> Self {
        Self::Analog { axis: VirtualAxis::Stick(axis), scale: 1.0 }
    }

    /// Creates a trigger of the gamepad: the value, limited to 0 to 1.
    pub fn trigger(button: GamepadButton) -> Self {
        Self::Analog { axis: VirtualAxis::Trigger(button), scale: 1.0 }
    }

    /// Moves the mouse to the right by `pixels` per tick for a value of 1.
    pub fn mouse_x(pixels: f32) -> Self {
        Self::Analog { axis: VirtualAxis::MouseX, scale: pixels }
    }

    /// Moves the mouse downwards by `pixels` per tick for a value of 1.
    pub fn mouse_y(pixels: f32) -> Self {
        Self::Analog { axis: VirtualAxis::MouseY, scale: pixels }
    }

    /// Turns the mouse wheel by `lines` per tick for a value of 1.
    pub fn wheel(lines: f32) -> Self {
        Self::Analog { axis: VirtualAxis::WheelY, scale: lines }
    }

    /// Adds the inputs that this value holds.
    pub(super) fn add_to(&self, held: HeldInput, value: f32) -> HeldInput {
        match self {
            Self::Buttons { positive, threshold, .. } if value > *threshold => held.hold(positive.iter().copied()),
            Self::Buttons { negative, threshold, .. } if value < -threshold => held.hold(negative.iter().copied()),
            Self::Buttons { .. } => held,
            Self::Analog { axis: axis @ VirtualAxis::Stick(_), scale } => {
                held.push(*axis, (value * scale).clamp(-1.0, 1.0))
            }
            Self::Analog { axis: axis @ VirtualAxis::Trigger(_), scale } => {
                held.push(*axis, (value * scale).clamp(0.0, 1.0))
            }
            Self::Analog { axis, scale } => held.push(*axis, value * scale),
        }
    }

    /// Returns all keys, buttons and axes that it may move.
    pub(super) fn reach(&self) -> HeldInput {
        match self {
            Self::Buttons { negative, positive, .. } => HeldInput::new(negative.iter().chain(positive).copied()),
            Self::Analog { axis, .. } => HeldInput::default().push(*axis, 0.0),
        }
    }
}

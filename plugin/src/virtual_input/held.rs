//! The set of inputs held at one time.

use bevy::prelude::*;

use super::{axis::VirtualAxis, button::VirtualButton};

/// The inputs that are held down and pushed while one action lasts.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_playbot::virtual_input::{HeldInput, VirtualAxis};
///
/// // Run to the right and look up.
/// let held = HeldInput::new([KeyCode::ShiftLeft, KeyCode::KeyD]).push(VirtualAxis::MouseY, -4.0);
/// assert_eq!(held.buttons.len(), 2);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct HeldInput {
    /// Keys and buttons that are down.
    pub buttons: Vec<VirtualButton>,
    /// Motions and sticks, with their values.
    pub axes: Vec<(VirtualAxis, f32)>,
}

impl HeldInput {
    /// Creates a set of these keys or buttons only.
    pub fn new<B: Into<VirtualButton>>(buttons: impl IntoIterator<Item = B>) -> Self {
        Self::default().hold(buttons)
    }

    /// Adds these keys or buttons.
    pub fn hold<B: Into<VirtualButton>>(mut self, buttons: impl IntoIterator<Item = B>) -> Self {
        for button in buttons {
            let button = button.into();
            if !self.buttons.contains(&button) {
                self.buttons.push(button);
            }
        }
        self
    }

    /// Adds a motion or stick; a second push of the same one is added to the first.
    pub fn push(mut self, axis: impl Into<VirtualAxis>, value: f32) -> Self {
        let axis = axis.into();
        match self.axes.iter_mut().find(|(pushed, _)| *pushed == axis) {
            Some((_, pushed)) => *pushed += value,
            None => self.axes.push((axis, value)),
        }
        self
    }
}

//! The return types of a game's own systems.

use bevy_playbot::action::ActionValue;

/// Values of an observation.
pub trait IntoValues: 'static {
    /// Returns the values in their order.
    fn into_values(self) -> Vec<f32>;
}

impl<const N: usize> IntoValues for [f32; N] {
    fn into_values(self) -> Vec<f32> {
        self.into()
    }
}

impl IntoValues for Vec<f32> {
    fn into_values(self) -> Vec<f32> {
        self
    }
}

/// The action of a demonstrator.
pub trait IntoActionValue: 'static {
    /// Returns the action.
    fn into_action(self) -> ActionValue;
}

impl IntoActionValue for ActionValue {
    fn into_action(self) -> ActionValue {
        self
    }
}

impl IntoActionValue for u32 {
    fn into_action(self) -> ActionValue {
        ActionValue::Discrete(self)
    }
}

impl IntoActionValue for usize {
    fn into_action(self) -> ActionValue {
        // An invalid number is refused as an action that does not exist.
        ActionValue::Discrete(u32::try_from(self).unwrap_or(u32::MAX))
    }
}

impl IntoActionValue for i32 {
    fn into_action(self) -> ActionValue {
        ActionValue::Discrete(u32::try_from(self).unwrap_or(u32::MAX))
    }
}

impl<const N: usize> IntoActionValue for [f32; N] {
    fn into_action(self) -> ActionValue {
        ActionValue::Continuous(self.into())
    }
}

impl IntoActionValue for Vec<f32> {
    fn into_action(self) -> ActionValue {
        ActionValue::Continuous(self)
    }
}

//! Which keys a person plays with, and which action they mean.

use bevy::prelude::*;

use crate::action::ActionValue;

/// Two directions and the keys that push each way. Keys for both ways at once cancel out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct KeyAxis {
    /// Keys for -1: left, down.
    pub negative: Vec<KeyCode>,
    /// Keys for 1: right, up.
    pub positive: Vec<KeyCode>,
}

impl KeyAxis {
    /// An axis with these keys.
    pub fn new(negative: impl Into<Vec<KeyCode>>, positive: impl Into<Vec<KeyCode>>) -> Self {
        Self { negative: negative.into(), positive: positive.into() }
    }

    /// -1, 0 or 1.
    fn value(&self, held: &impl Fn(KeyCode) -> bool) -> i8 {
        let any = |keys: &[KeyCode]| i8::from(keys.iter().any(|&key| held(key)));
        any(&self.positive) - any(&self.negative)
    }
}

/// The keys of an agent that a person plays: each axis has a value of -1, 0 or 1, and all values together are an action.
///
/// Works on agents under [`Control::Human`](crate::control::Control::Human) in an app with
/// [`KeyboardPlugin`](crate::keyboard::KeyboardPlugin).
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct KeyBindings {
    axes: Vec<KeyAxis>,
    action: fn(&[i8]) -> ActionValue,
    help: &'static str,
}

impl KeyBindings {
    /// A map over these axes. `action` gets one value per axis; `help` tells a person which keys there are.
    pub fn new(axes: impl Into<Vec<KeyAxis>>, action: fn(&[i8]) -> ActionValue, help: &'static str) -> Self {
        Self { axes: axes.into(), action, help }
    }

    /// The action of the keys that are held.
    pub fn action(&self, held: impl Fn(KeyCode) -> bool) -> ActionValue {
        let values: Vec<_> = self.axes.iter().map(|axis| axis.value(&held)).collect();
        (self.action)(&values)
    }

    /// Which keys there are, for people.
    pub fn help(&self) -> &'static str {
        self.help
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> KeyBindings {
        let axes = [
            KeyAxis::new([KeyCode::KeyA, KeyCode::ArrowLeft], [KeyCode::KeyD]),
            KeyAxis::new([KeyCode::KeyS], [KeyCode::KeyW]),
        ];
        KeyBindings::new(axes, |values| ActionValue::Continuous(values.iter().map(|&value| value.into()).collect()), "")
    }

    #[test]
    fn each_axis_is_pushed_by_its_keys_and_both_ways_cancel() {
        for (held, values) in [
            (&[][..], [0.0, 0.0]),
            (&[KeyCode::ArrowLeft], [-1.0, 0.0]),
            (&[KeyCode::KeyA, KeyCode::ArrowLeft, KeyCode::KeyW], [-1.0, 1.0]),
            (&[KeyCode::KeyA, KeyCode::KeyD, KeyCode::KeyS], [0.0, -1.0]),
            (&[KeyCode::KeyQ], [0.0, 0.0]),
        ] {
            let action = map().action(|key| held.contains(&key));
            assert_eq!(action, ActionValue::Continuous(values.to_vec()), "{held:?}");
        }
    }
}

//! Key bindings of a person, and the actions that the keys stand for.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//!
//! let steer = KeyAxis::new([KeyCode::ArrowLeft], [KeyCode::ArrowRight]);
//! let gas = KeyAxis::new([], [KeyCode::Space]);
//! let drive = |axes: &[i8]| ActionValue::Continuous(axes.iter().map(|&value| f32::from(value)).collect());
//! let keys = KeyBindings::new([steer, gas], drive, "arrows steer, space is the throttle");
//! let held = [KeyCode::ArrowLeft, KeyCode::Space];
//! assert_eq!(keys.action(|key| held.contains(&key)), ActionValue::Continuous(vec![-1.0, 1.0]));
//! ```

use std::{borrow::Cow, fmt, sync::Arc};

use bevy::prelude::*;

use crate::action::ActionValue;

/// An axis with the keys that push it in each direction. Keys for opposite directions cancel out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct KeyAxis {
    /// Keys for -1: left, down.
    pub negative: Vec<KeyCode>,
    /// Keys for 1: right, up.
    pub positive: Vec<KeyCode>,
}

impl KeyAxis {
    /// Creates an axis with these keys.
    pub fn new(negative: impl Into<Vec<KeyCode>>, positive: impl Into<Vec<KeyCode>>) -> Self {
        Self { negative: negative.into(), positive: positive.into() }
    }

    /// Returns -1, 0 or 1.
    fn value(&self, held: &impl Fn(KeyCode) -> bool) -> i8 {
        let any = |keys: &[KeyCode]| i8::from(keys.iter().any(|&key| held(key)));
        any(&self.positive) - any(&self.negative)
    }
}

/// The keys of an agent that a person plays. Each axis has a value of -1, 0 or 1, and all values
/// together are an action.
///
/// Works on agents under [`Control::Human`](crate::control::Control::Human) in an app with
/// [`KeyboardPlugin`](crate::keyboard::KeyboardPlugin).
#[derive(Component, Clone, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct KeyBindings {
    axes: Vec<KeyAxis>,
    action: Arc<dyn Fn(&[i8]) -> ActionValue + Send + Sync>,
    help: Cow<'static, str>,
}

impl fmt::Debug for KeyBindings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("KeyBindings").field("axes", &self.axes).field("help", &self.help).finish_non_exhaustive()
    }
}

impl KeyBindings {
    /// Creates bindings over these axes. `action` gets one value per axis; `help` describes the
    /// keys to a person.
    pub fn new(
        axes: impl Into<Vec<KeyAxis>>,
        action: impl Fn(&[i8]) -> ActionValue + Send + Sync + 'static,
        help: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self { axes: axes.into(), action: Arc::new(action), help: help.into() }
    }

    /// Creates bindings from a game's own keys: discrete action i means that the keys of set i are
    /// held. Of several sets that are held, the one with the most keys counts.
    pub fn of_sets(sets: &[Vec<KeyCode>]) -> Self {
        let mut keys = Vec::new();
        for key in sets.iter().flatten() {
            if !keys.contains(key) {
                keys.push(*key);
            }
        }
        let axes: Vec<_> = keys.iter().map(|&key| KeyAxis::new([], [key])).collect();
        let place = |key: &KeyCode| keys.iter().position(|known| known == key).unwrap_or_default();
        let sets: Vec<Vec<usize>> = sets.iter().map(|set| set.iter().map(place).collect()).collect();
        let action = move |held: &[i8]| {
            let fits = |set: &&(usize, &Vec<usize>)| set.1.iter().all(|&key| held[key] > 0);
            let fitting = sets.iter().enumerate().collect::<Vec<_>>();
            // The first of those with the most keys: `max_by_key` would take the last.
            let best = fitting.iter().filter(fits).rev().max_by_key(|(_, set)| set.len());
            ActionValue::Discrete(best.map_or(0, |(action, _)| *action as u32))
        };
        let help = keys.iter().map(|key| format!("{key:?}")).collect::<Vec<_>>().join(", ");
        Self::new(axes, action, help)
    }

    /// Returns the action of the keys that are held.
    pub fn action(&self, held: impl Fn(KeyCode) -> bool) -> ActionValue {
        let values: Vec<_> = self.axes.iter().map(|axis| axis.value(&held)).collect();
        (self.action)(&values)
    }

    /// Returns the description of the keys, for people.
    pub fn help(&self) -> &str {
        &self.help
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

    #[test]
    fn the_keys_of_a_game_say_which_action_is_meant() {
        let sets = [vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowLeft, KeyCode::Space], vec![KeyCode::Space]];
        let bindings = KeyBindings::of_sets(&sets);
        for (held, action) in [
            (&[][..], 0),
            (&[KeyCode::ArrowLeft], 1),
            (&[KeyCode::Space, KeyCode::ArrowLeft], 2),
            (&[KeyCode::Space, KeyCode::KeyQ], 3),
        ] {
            assert_eq!(bindings.action(|key| held.contains(&key)), ActionValue::Discrete(action), "{held:?}");
        }
        assert_eq!(bindings.help(), "ArrowLeft, Space");
    }
}

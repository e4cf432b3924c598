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
//!
//! # People at the keyboard
//!
//! ```
//! use bevy::{input::InputPlugin, prelude::*};
//! use bevy_playbot::{key_bindings::KeyboardPlugin, prelude::*};
//!
//! let mut app = headless_app();
//! app.add_plugins((InputPlugin, KeyboardPlugin));
//! // Action 0 has no key, action 1 the space bar.
//! let keys = KeyBindings::of_sets(&[vec![], vec![KeyCode::Space]]);
//! let agent = app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human, keys)).id();
//! app.tick().expect("no agent broke its contract");
//! assert_eq!(app.world().get::<Action>(agent), Some(&Action(ActionValue::Discrete(0))));
//! app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(KeyCode::Space);
//! app.tick().expect("no agent broke its contract");
//! assert_eq!(app.world().get::<Action>(agent), Some(&Action(ActionValue::Discrete(1))));
//! ```

use crate::{
    action::{Action, ActionValue},
    agent::Control,
    bot,
    episode::Episode,
    placement::{TickPlacement, TickSchedules, is_tick},
    systems::PlaybotSystems,
    virtual_input::VirtualButton,
};
use bevy::{input::InputSystems, prelude::*};
use std::{borrow::Cow, fmt, sync::Arc};

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
/// Works on agents under [`Control::Human`] in an app with
/// [`KeyboardPlugin`].
#[derive(Component, Clone, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
#[require(MissingSet)]
pub struct KeyBindings {
    axes: Vec<KeyAxis>,
    /// The keys that each discrete action holds, if the bindings were made from them.
    sets: Vec<Vec<KeyCode>>,
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
        Self { axes: axes.into(), sets: Vec::new(), action: Arc::new(action), help: help.into() }
    }

    /// Creates bindings from a game's own keys: discrete action i means that the keys of set i are
    /// held. Of several sets that are held, the one with the most keys counts. Where no set is held, action 0 counts:
    /// [`missing_set`](Self::missing_set) says so.
    pub fn of_sets(sets: &[Vec<KeyCode>]) -> Self {
        let of_game = sets.to_vec();
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
        Self { sets: of_game, ..Self::new(axes, action, help) }
    }

    /// Returns the action of the keys that are held.
    pub fn action(&self, held: impl Fn(KeyCode) -> bool) -> ActionValue {
        let values: Vec<_> = self.axes.iter().map(|axis| axis.value(&held)).collect();
        (self.action)(&values)
    }

    /// Returns the keys that are held, if the bindings are [`of_sets`](Self::of_sets) and no action holds exactly these.
    /// The list is empty if no key is held, and no action holds nothing.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use bevy_playbot::key_bindings::KeyBindings;
    ///
    /// let [left, right] = [KeyCode::ArrowLeft, KeyCode::ArrowRight];
    /// let keys = KeyBindings::of_sets(&[vec![left], vec![right]]);
    /// assert_eq!(keys.missing_set(|key| key == left), None);
    /// assert_eq!(keys.missing_set(|_| true), Some(vec![left, right]));
    /// assert_eq!(keys.missing_set(|_| false), Some(vec![]));
    /// ```
    pub fn missing_set(&self, held: impl Fn(KeyCode) -> bool) -> Option<Vec<KeyCode>> {
        let known = self.axes.iter().flat_map(|axis| &axis.positive).copied();
        let is_held = |key: &KeyCode| held(*key);
        let is_exact =
            |set: &Vec<KeyCode>| set.iter().all(is_held) && known.clone().filter(is_held).all(|key| set.contains(&key));
        let is_missing = !self.sets.is_empty() && !self.sets.iter().any(is_exact);
        is_missing.then(|| known.clone().filter(is_held).collect())
    }

    /// Returns false if the bindings are [`of_sets`](Self::of_sets), none of which is empty: a person who holds no key
    /// then gets action 0.
    pub fn has_idle_action(&self) -> bool {
        self.sets.is_empty() || self.sets.iter().any(Vec::is_empty)
    }

    /// Returns the description of the keys, for people.
    pub fn help(&self) -> &str {
        &self.help
    }
}

/// The keys and buttons that a person held in the last tick without an action that holds exactly these: see
/// [`KeyBindings::missing_set`]. Written together with the [`Action`] of agents under [`Control::Human`].
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct MissingSet(pub Option<Vec<VirtualButton>>);

impl MissingSet {
    /// Replaces the set by one of keys.
    pub fn set_keys(&mut self, keys: Option<Vec<KeyCode>>) {
        self.0 = keys.map(|keys| keys.into_iter().map(VirtualButton::Key).collect());
    }
}

/// Turns keys into the actions of agents under [`Control::Human`] that have [`KeyBindings`]. Add it
/// after [`PlaybotPlugin`](crate::plugin::PlaybotPlugin).
///
/// Ticks and frames have their own rates. A key counts in a tick if it is held then, or was pressed
/// since the tick before. So a short tap between two ticks is not lost. Needs Bevy's `InputPlugin`.
#[derive(Clone, Copy, Debug, Default)]
pub struct KeyboardPlugin;

/// Keys that were pressed since the last tick, even if they are released by now.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct TappedKeys(Vec<KeyCode>);

impl TappedKeys {
    /// Drops the taps: keys pressed while the game was paused are not meant for it.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

impl Plugin for KeyboardPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<TappedKeys>().add_systems(PreUpdate, note_taps.after(InputSystems));
        match TickSchedules::of(app).placement {
            TickPlacement::Fixed => {
                app.add_systems(FixedPreUpdate, decide.in_set(PlaybotSystems::Decide).before(bot::run_blind_bots))
            }
            // The game reads the keys of this frame, so the action is made of the same keys.
            TickPlacement::Frame => app.add_systems(PreUpdate, decide.after(note_taps).run_if(is_tick)),
        };
    }
}

pub(crate) fn note_taps(keys: Res<ButtonInput<KeyCode>>, mut tapped: ResMut<TappedKeys>) {
    // Their order is unspecified, and irrelevant: they are only searched.
    tapped.0.extend(keys.get_just_pressed());
}

fn decide(
    keys: Res<ButtonInput<KeyCode>>,
    mut tapped: ResMut<TappedKeys>,
    mut agents: Query<(&Control, &KeyBindings, &Episode, &mut Action, &mut MissingSet)>,
) {
    for (control, map, episode, mut action, mut missing) in &mut agents {
        if *control == Control::Human && episode.is_running() {
            let is_held = |key| keys.pressed(key) || tapped.0.contains(&key);
            action.0 = map.action(is_held);
            missing.set_keys(map.missing_set(is_held));
        }
    }
    tapped.clear();
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

    #[test]
    fn keys_that_no_action_holds_together_are_named() {
        let [left, right, space] = [KeyCode::ArrowLeft, KeyCode::ArrowRight, KeyCode::Space];
        let bindings = KeyBindings::of_sets(&[vec![], vec![left], vec![right], vec![space], vec![space, right]]);
        assert!(bindings.has_idle_action());
        for (held, missing) in [
            (&[][..], None),
            (&[left], None),
            (&[right, space], None),
            (&[left, KeyCode::KeyQ], None),
            (&[left, space], Some(vec![left, space])),
            (&[space, right, left], Some(vec![left, right, space])),
        ] {
            assert_eq!(bindings.missing_set(|key| held.contains(&key)), missing, "{held:?}");
        }
    }

    #[test]
    fn a_game_without_an_idle_action_says_so_while_no_key_is_held() {
        let bindings = KeyBindings::of_sets(&[vec![KeyCode::ArrowLeft, KeyCode::Space]]);
        assert!(!bindings.has_idle_action());
        assert_eq!(bindings.missing_set(|_| false), Some(vec![]));
        assert_eq!(bindings.missing_set(|key| key == KeyCode::Space), Some(vec![KeyCode::Space]), "half of a set");
        assert!(map().has_idle_action(), "axes rest at 0");
        assert_eq!(map().missing_set(|_| true), None);
    }
}

//! People at the keyboard.
//!
//! ```
//! use bevy::{input::InputPlugin, prelude::*};
//! use bevy_playbot::{keyboard::KeyboardPlugin, prelude::*};
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

use bevy::{input::InputSystems, prelude::*};

use crate::{
    action::Action,
    bot,
    control::Control,
    episode::Episode,
    key_bindings::KeyBindings,
    placement::{TickPlacement, TickSchedules, is_tick},
    systems::PlaybotSystems,
};

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
// Hidden here and below: for playbot_lab, playbot_cli and tests; games need none of it.
#[doc(hidden)]
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
    mut agents: Query<(&Control, &KeyBindings, &Episode, &mut Action)>,
) {
    for (control, map, episode, mut action) in &mut agents {
        if *control == Control::Human && episode.is_running() {
            action.0 = map.action(|key| keys.pressed(key) || tapped.0.contains(&key));
        }
    }
    tapped.clear();
}

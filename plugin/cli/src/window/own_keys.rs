//! The state of the person's keyboard, whatever keys the game sees.

use bevy::{input::InputSystems, prelude::*};

/// Held and just pressed keys of the person's keyboard, as of this frame of the window.
#[derive(Resource, Clone, Default, Deref, DerefMut, Reflect)]
#[reflect(Resource)]
pub(super) struct OwnKeys(pub(super) ButtonInput<KeyCode>);

/// The set in which they are read, in `PreUpdate`, where the game sees the same keyboard.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct OwnKeysRead;

/// Reads the keys in games that see the person's keyboard.
pub(super) fn build(app: &mut App) {
    let read = |keys: Res<ButtonInput<KeyCode>>, mut own: ResMut<OwnKeys>| own.0.clone_from(&keys);
    app.init_resource::<OwnKeys>().add_systems(PreUpdate, read.in_set(OwnKeysRead).after(InputSystems));
}

//! A mark for apps that nobody looks at.

use bevy::prelude::*;

/// The app has no screen, so that nothing needs to be drawn but what agents ask for.
#[derive(Resource, Clone, Copy, Debug, Reflect)]
#[reflect(Resource)]
pub(crate) struct NoScreen;

/// Marks an app with [`NoScreen`].
pub(crate) struct NoScreenPlugin;

impl Plugin for NoScreenPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(NoScreen);
    }
}

//! A marker for apps without a screen.

use bevy::prelude::*;

/// Marks an app without a screen: only the pictures of agents need to be drawn.
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

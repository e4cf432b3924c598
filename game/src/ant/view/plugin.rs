//! Drawing ants as a Bevy plugin.

use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_lab::prelude::*;

use super::{flat::FlatViewPlugin, systems::AntViewSystems};

/// Draws ants. Add it after the plugins that bring images, such as Bevy's own or a sensor's.
#[derive(Clone, Copy, Debug, Default)]
pub struct AntViewPlugin;

impl Plugin for AntViewPlugin {
    fn build(&self, app: &mut App) {
        app.configure_sets(
            ObserveSchedule,
            (AntViewSystems::Show, AntViewSystems::Draw).chain().in_set(VisionSystems::Sync),
        )
        .add_plugins(FlatViewPlugin);
    }
}

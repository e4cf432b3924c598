//! The view in space as a Bevy plugin.

use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_lab::prelude::*;

use super::{ants, scenery};
use crate::ant::view::AntViewSystems;

/// Adds meshes to all entities that [`AntViewPlugin`](crate::ant::view::AntViewPlugin) draws. x, y and z are those of
/// the physics: z is up. The camera is the window's.
#[derive(Clone, Copy, Debug, Default)]
pub struct SolidViewPlugin;

impl Plugin for SolidViewPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(GlobalAmbientLight { brightness: 400.0, ..default() })
            .add_systems(Startup, (scenery::sun, scenery::paints).chain())
            .add_systems(
                ObserveSchedule,
                (scenery::grounds, ants::build, ants::goals, ants::note_poses)
                    .chain()
                    .after(AntViewSystems::Draw)
                    .in_set(VisionSystems::Sync),
            )
            .add_systems(Update, ants::glide);
    }
}

//! In space, with meshes, a sun and shadows: for people in a window.

mod ants;
mod scenery;

use bevy::prelude::*;
use playbot_lab::prelude::*;

use super::AntViewSystems;

/// Adds meshes to everything that [`AntViewPlugin`](super::AntViewPlugin) draws. x, y and z are those of the physics: z is
/// up. The camera is the window's.
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
                    .in_set(bevy_playbot::vision::VisionSystems::Dress),
            )
            .add_systems(Update, ants::glide);
    }
}

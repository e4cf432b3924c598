//! What Maze2D looks like: the whole maze from above, first row at the top, the ball in it and the goal.
//!
//! A maze of any size fills the picture. The ball is drawn larger than it is, so that it can be seen on 64 pixels.

mod art;
mod dress;

use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_lab::prelude::*;

/// Width of what an agent sees, in world units: the longer side of the maze.
pub const VIEW: f32 = 12.0;

/// Adds sprites and tiles to [`Maze2dPlugin`](super::Maze2dPlugin). Add it after the plugins that bring images, such as
/// Bevy's own or a sensor's.
#[derive(Clone, Copy, Debug, Default)]
pub struct Maze2dPicturePlugin;

impl Plugin for Maze2dPicturePlugin {
    fn build(&self, app: &mut App) {
        let mut images = app.world_mut().get_resource_or_init::<Assets<Image>>();
        let art = art::Art::add_to(&mut images);
        app.insert_resource(art).init_resource::<dress::Stages>().add_systems(
            ObserveSchedule,
            (dress::players, dress::levels, dress::balls).chain().in_set(VisionSystems::Dress),
        );
    }
}

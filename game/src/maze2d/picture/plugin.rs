//! The picture of Maze2D as a Bevy plugin.

use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_lab::prelude::*;

use super::{art::Art, board};
use crate::arena_grid::ArenaGrid;

/// Adds sprites and tiles to [`Maze2dPlugin`](crate::maze2d::Maze2dPlugin). Add it after the plugins that bring images,
/// such as Bevy's own or a sensor's.
#[derive(Clone, Copy, Debug, Default)]
pub struct Maze2dPicturePlugin;

impl Plugin for Maze2dPicturePlugin {
    fn build(&self, app: &mut App) {
        let mut images = app.world_mut().get_resource_or_init::<Assets<Image>>();
        let art = Art::add_to(&mut images);
        app.insert_resource(art).init_resource::<ArenaGrid>().add_systems(
            ObserveSchedule,
            (board::players, board::levels, board::balls).chain().in_set(VisionSystems::Sync),
        );
    }
}

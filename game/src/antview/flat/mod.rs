//! From above, with sprites.

mod art;
mod ground;
mod limbs;

use bevy::prelude::*;
use playbot_lab::prelude::*;

use super::AntViewSystems;
use art::Art;
#[cfg(feature = "view3d")]
pub(super) use {
    art::floor_tile,
    limbs::{GOAL_COLOUR, colour},
};

/// Metres from the left to the right edge of what an agent sees: four cells of a maze.
pub const VIEW: f32 = 16.0;

/// Layers, the farthest first.
const GROUND: f32 = -2.0;
const GOAL: f32 = -1.0;
const LIMBS: f32 = 0.0;

pub(super) fn build(app: &mut App) {
    let mut images = app.world_mut().get_resource_or_init::<Assets<Image>>();
    let art = Art::add_to(&mut images);
    app.insert_resource(art).init_resource::<ground::Stages>().add_systems(
        ObserveSchedule,
        (ground::stages, ground::tiles, ground::follow, limbs::dress, limbs::pose, limbs::goals)
            .chain()
            .in_set(AntViewSystems::Draw),
    );
}

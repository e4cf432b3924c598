//! The view from above as a Bevy plugin.

use bevy::prelude::*;
use playbot_lab::prelude::*;

use super::{art::Art, ground, limbs};
use crate::{ant::view::AntViewSystems, arena_grid::ArenaGrid};

/// Draws ants and grounds with sprites.
pub struct FlatViewPlugin;

impl Plugin for FlatViewPlugin {
    fn build(&self, app: &mut App) {
        let mut images = app.world_mut().get_resource_or_init::<Assets<Image>>();
        let art = Art::add_to(&mut images);
        app.insert_resource(art).init_resource::<ArenaGrid>().add_systems(
            ObserveSchedule,
            (ground::stages, ground::tiles, ground::follow, limbs::spawn, limbs::pose, limbs::goals)
                .chain()
                .in_set(AntViewSystems::Draw),
        );
    }
}

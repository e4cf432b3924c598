//! The picture of CoinRun as a Bevy plugin.

use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_lab::prelude::*;

use super::{animate, art::Art, sprites, trail};
use crate::arena_grid::ArenaGrid;

/// Adds sprites and tiles to [`CoinRunPlugin`](crate::coinrun::CoinRunPlugin). Add it after the plugins that bring
/// images, such as Bevy's own or a sensor's.
#[derive(Clone, Copy, Debug, Default)]
pub struct CoinRunPicturePlugin;

impl Plugin for CoinRunPicturePlugin {
    fn build(&self, app: &mut App) {
        let mut images = app.world_mut().get_resource_or_init::<Assets<Image>>();
        let art = Art::add_to(&mut images);
        app.insert_resource(art).init_resource::<ArenaGrid>().add_systems(
            ObserveSchedule,
            (
                sprites::players,
                sprites::levels,
                sprites::entities,
                animate::players,
                animate::enemies,
                animate::saws,
                animate::moved_blocks,
                trail::trails,
            )
                .chain()
                .in_set(VisionSystems::Sync),
        );
    }
}

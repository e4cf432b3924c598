//! What CoinRun looks like: Procgen's picture, with drawings of our own.
//!
//! Each arena becomes a [`Stage`](bevy_playbot::vision::Stage) with a backdrop, its tiles and a sprite for everything
//! that lives in it, in the arena's own coordinates: one unit is one tile. Nothing here changes the game, and whatever is
//! shown follows from the episode alone: animations count its ticks, and enemies leave puffs where they were.

mod animate;
mod art;
mod dress;
mod puffs;
mod trail;

pub use art::{Art, Pose};

use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_lab::prelude::*;

/// Tiles from the left to the right edge of what an agent sees.
pub const VIEW: f32 = 13.0;

/// Adds sprites and tiles to [`CoinRunPlugin`](super::CoinRunPlugin). Add it after the plugins that bring images, such as
/// Bevy's own or a sensor's.
#[derive(Clone, Copy, Debug, Default)]
pub struct CoinRunPicturePlugin;

impl Plugin for CoinRunPicturePlugin {
    fn build(&self, app: &mut App) {
        let mut images = app.world_mut().get_resource_or_init::<Assets<Image>>();
        let art = Art::add_to(&mut images);
        app.insert_resource(art).init_resource::<dress::Stages>().add_systems(
            ObserveSchedule,
            (
                dress::players,
                dress::levels,
                dress::inhabitants,
                animate::players,
                animate::enemies,
                animate::saws,
                animate::moved_blocks,
                trail::trails,
            )
                .chain()
                .in_set(VisionSystems::Dress),
        );
    }
}

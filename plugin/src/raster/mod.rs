//! Pictures of 2D sprites drawn on the CPU.

mod sensor;

pub use sensor::RasterSensor;

use bevy::prelude::*;

use crate::vision::VisionPlugin;

/// Adds [`RasterSensor`]s to a game.
#[derive(Clone, Copy, Debug, Default)]
pub struct RasterPlugin;

impl Plugin for RasterPlugin {
    fn build(&self, app: &mut App) {
        VisionPlugin::add_to(app);
    }
}

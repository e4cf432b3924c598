//! The plugin of [`RasterSensor`](super::RasterSensor)s.

use bevy::prelude::*;

use super::renderer::fill_frames;
use crate::{
    systems::ObserveSchedule,
    vision::{VisionPlugin, VisionSystems},
};

/// Adds [`RasterSensor`](super::RasterSensor)s to a game.
#[derive(Clone, Copy, Debug, Default)]
pub struct RasterPlugin;

impl Plugin for RasterPlugin {
    fn build(&self, app: &mut App) {
        VisionPlugin::add_to(app);
        app.init_resource::<Assets<Image>>()
            .init_resource::<Assets<TextureAtlasLayout>>()
            .add_systems(ObserveSchedule, fill_frames.in_set(VisionSystems::Render));
    }
}

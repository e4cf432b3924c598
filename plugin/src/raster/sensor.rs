//! The sensor that draws on the CPU.

use bevy::prelude::*;

use crate::vision::{ImageOptions, ImageSensor};

/// Draws the surroundings of an entity, as a [`CameraSensor`](crate::camera) would show them,
/// without a GPU.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
#[require(ImageSensor)]
pub struct RasterSensor {
    /// The entity in the middle of the picture.
    pub target: Entity,
    /// World units from the left to the right edge of the picture.
    pub width: f32,
}

impl RasterSensor {
    /// Returns the components of an agent that sees `width` units of the world around `target`.
    pub fn following(target: Entity, width: f32, image: ImageOptions) -> (Self, ImageSensor) {
        (Self { target, width }, ImageSensor(image))
    }
}

//! The eye that is a Bevy camera.

use bevy::prelude::*;

use crate::vision::{ImageOptions, ImageSensor};

/// Renders what lies around an entity with a Bevy camera.
#[derive(Component, Clone, Copy, Debug)]
#[require(ImageSensor)]
pub struct CameraSensor {
    /// The entity in the middle of the picture.
    pub target: Entity,
    /// World units from the left to the right edge of the picture.
    pub width: f32,
}

impl CameraSensor {
    /// The components of an agent that sees `width` units of the world around `target`.
    pub fn following(target: Entity, width: f32, image: ImageOptions) -> (Self, ImageSensor) {
        (Self { target, width }, ImageSensor(image))
    }
}

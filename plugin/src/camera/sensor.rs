//! The eye that is a Bevy camera.

use bevy::prelude::*;

use crate::vision::{ImageOptions, ImageSensor};

/// Where a [`CameraSensor`] looks from.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub enum CameraSource {
    /// Straight down on the 2D scene around an entity.
    Following {
        /// The entity in the middle of the picture. It needs a `Transform`.
        target: Entity,
        /// World units from the left to the right edge of the picture.
        width: f32,
    },
    /// Through a camera of the game.
    Camera(Entity),
    /// Through the game's own camera, whichever entity that is now: of several active ones, the one that draws first.
    OfGame,
}

/// Fills an agent's [`Frame`](crate::vision::Frame) with what Bevy's renderer draws.
///
/// One that follows a target sees the 2D scene on render layer 0, in front of the World's `ClearColor`: sprites, tile
/// layers, 2D meshes. Colours come back as the bytes of the images they are from.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component)]
#[require(ImageSensor)]
pub struct CameraSensor {
    /// Where it looks from.
    pub source: CameraSource,
}

impl CameraSensor {
    /// The components of an agent that sees `width` units of the world around `target`.
    pub fn following(target: Entity, width: f32, image: ImageOptions) -> (Self, ImageSensor) {
        (Self { source: CameraSource::Following { target, width } }, ImageSensor(image))
    }

    /// The components of an agent that sees what the game's own camera sees: see [`CameraSource::OfGame`].
    pub fn of_game(image: ImageOptions) -> (Self, ImageSensor) {
        (Self { source: CameraSource::OfGame }, ImageSensor(image))
    }

    /// The components of an agent that sees what a camera of the game sees, 2D or 3D, squeezed into the picture's size.
    ///
    /// Several agents may look through one camera if their pictures have the same size. A camera whose own target does
    /// not exist, such as the window of an app without one, sees what it would see in a window of the picture's size.
    pub fn of(camera: Entity, image: ImageOptions) -> (Self, ImageSensor) {
        (Self { source: CameraSource::Camera(camera) }, ImageSensor(image))
    }
}

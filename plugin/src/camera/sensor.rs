//! The sensor that is a Bevy camera.

use bevy::prelude::*;

use crate::vision::{ImageOptions, ImageSensor};

/// The viewpoint of a [`CameraSensor`].
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
    /// Through the game's own camera, whichever entity it is now: of several active ones, the one that draws first.
    OfGame,
}

/// Fills an agent's [`Frame`](crate::vision::Frame) with the picture of Bevy's renderer.
///
/// A sensor that follows a target sees the 2D scene on render layer 0, in front of the World's `ClearColor`: sprites,
/// tile layers, 2D meshes. Colours come back as the bytes of the images they are from.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component)]
#[require(ImageSensor)]
pub struct CameraSensor {
    /// The viewpoint.
    pub source: CameraSource,
}

impl CameraSensor {
    /// Returns the components of an agent that sees `width` units of the world around `target`.
    pub fn following(target: Entity, width: f32, image: ImageOptions) -> (Self, ImageSensor) {
        (Self { source: CameraSource::Following { target, width } }, ImageSensor(image))
    }

    /// Returns the components of an agent that sees through the game's own camera: see [`CameraSource::OfGame`].
    pub fn of_game(image: ImageOptions) -> (Self, ImageSensor) {
        (Self { source: CameraSource::OfGame }, ImageSensor(image))
    }

    /// Returns the components of an agent that sees through a camera of the game, 2D or 3D, scaled to the picture's
    /// size.
    ///
    /// Several agents may look through one camera if their pictures have the same size. If the camera's own target
    /// does not exist, such as the window of an app without one, it draws as for a window of the picture's size.
    pub fn of(camera: Entity, image: ImageOptions) -> (Self, ImageSensor) {
        (Self { source: CameraSource::Camera(camera) }, ImageSensor(image))
    }
}

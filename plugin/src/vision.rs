//! Image observations: sensors, frames and their options.
//!
//! | part | what it is |
//! |---|---|
//! | [`ImageSensor`] | size and form of the pictures an agent's policy reads |
//! | [`Frame`] | the RGB picture of this tick, stamped with it, from whichever sensor |
//! | [`Stage`] | the root of an arena that is drawn by itself |
//! | [`TileLayer`] | a grid of tiles, drawn at once |
//!
//! A sensor fills [`Frame`] in [`VisionSystems::Render`]. [`VisionSystems::Compose`] checks its
//! tick and makes [`Observation::image`] from it. Idle
//! agents and agents between two episodes are skipped.
//!
//! The files of the folder, in reading order:
//!
//! - `options`: size and form of pictures, frames, and the bytes that a policy reads.
//! - `compose`: observations from frames.
//! - `tile_layer`: the grid of tiles that is drawn as one.
//! - `metadata`: the metadata of pictures in files of networks, and differences between pictures.
//!
//! ```
//! use bevy_playbot::vision::{ImageOptions, ObservationConfig, ObservationKind};
//!
//! let image = ImageOptions { width: 32, height: 24, stack: 4, grayscale: true, ..Default::default() };
//! image.check().expect("sizes that can be drawn");
//! assert_eq!(image.shape().numbers(), 4 * 24 * 32);
//! let config = ObservationConfig { kind: ObservationKind::Raster, image };
//! assert_eq!(config.to_string(), "32×24 grey pictures of the raster, 4 in a stack");
//! ```

mod compose;
mod metadata;
mod options;
mod tile_layer;

use crate::{observation::Observation, systems::ObserveSchedule, unknown_name::UnknownName};
use bevy::{ecs::schedule::SystemSet, prelude::*};
use playbot_learner::ObsKind;
use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};

pub use crate::vision::metadata::{CLOSE, PictureDifference};
pub use crate::vision::options::BlankEpisodes;
pub(crate) use crate::vision::{
    compose::{check_images, is_observed},
    tile_layer::{NO_IMAGE, lacks_image},
};
pub use crate::vision::{
    metadata::UnknownObservation,
    options::{Frame, ImageOptions, ImageSensor, MAX_SIDE, PaintedVelocity, VisionError},
    tile_layer::TileLayer,
};

/// The observation of agents, with the form of pictures.
///
/// Policies and skill models that read pictures carry it in their files: images of equal shape can
/// show different things.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObservationConfig {
    /// Vector or pictures.
    pub kind: ObservationKind,
    /// Size and form of the pictures.
    pub image: ImageOptions,
}

impl fmt::Display for ObservationConfig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.is_image() {
            return f.write_str("vectors");
        }
        let ImageOptions { width, height, stack, grayscale, paint_velocity } = self.image;
        let colours = if grayscale { "grey" } else { "colour" };
        write!(f, "{width}×{height} {colours} pictures of the {}", self.kind)?;
        if stack > 1 {
            write!(f, ", {stack} in a stack")?;
        }
        if paint_velocity { write!(f, ", with painted velocity") } else { Ok(()) }
    }
}

impl ObservationConfig {
    /// Returns whether agents see pictures.
    pub fn is_image(&self) -> bool {
        self.kind != ObservationKind::Vector
    }
}

/// The kind of an observation. Its [`name`](Self::name) is used on the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ObservationKind {
    /// The game's vector of numbers.
    #[default]
    Vector,
    /// Pictures drawn on the CPU.
    Raster,
    /// Pictures from a Bevy camera; needs the feature `camera` and a GPU or software Vulkan.
    Camera,
}

impl ObservationKind {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Vector, Self::Raster, Self::Camera];

    /// Returns the name on the command line and in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vector => "vector",
            Self::Raster => "raster",
            Self::Camera => "camera",
        }
    }
}

impl fmt::Display for ObservationKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ObservationKind {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let found = Self::ALL.into_iter().find(|kind| kind.name() == name);
        found.ok_or_else(|| UnknownName::new("observation", name, &Self::ALL.map(Self::name)))
    }
}

/// The extent of the game's picture for agents that see pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picture {
    /// World units from the left to the right edge of an agent's picture, which is centred on the
    /// agent.
    pub width: f32,
    /// Smallest height of a picture in world units. A picture that is too low for it shows more on
    /// both sides. 0 for no limit.
    pub least_height: f32,
}

impl Picture {
    /// Returns the world units from the left to the right edge of a picture of this size.
    pub fn width_on(&self, image: &ImageOptions) -> f32 {
        self.width.max(self.least_height * image.width as f32 / image.height as f32)
    }
}

/// Makes observations from the frames of any sensor. The sensors' plugins add it.
#[derive(Clone, Copy, Debug, Default)]
pub struct VisionPlugin;

impl VisionPlugin {
    /// Adds the plugin unless another sensor did.
    pub fn add_to(app: &mut App) {
        if !app.is_plugin_added::<Self>() {
            app.add_plugins(Self);
        }
    }
}

impl Plugin for VisionPlugin {
    fn build(&self, app: &mut App) {
        app.configure_sets(
            ObserveSchedule,
            (VisionSystems::Sync, VisionSystems::Render, VisionSystems::Compose).chain(),
        )
        // Games fill the vector of an observation and this the image, so their order does not matter.
        .add_systems(ObserveSchedule, compose::compose.in_set(VisionSystems::Compose).ambiguous_with_all())
        .add_observer(options::report_blank);
    }
}

/// Parts of [`ObserveSchedule`] for agents that see pictures, in this order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VisionSystems {
    /// The game updates the drawn components: transforms, sprites, tiles.
    Sync,
    /// Sensors fill each agent's [`Frame`].
    Render,
    /// The frame's tick is checked, and the observation made from it.
    Compose,
}

/// The root of an arena whose agents see only its own contents.
///
/// All drawn entities of the arena, and the agents that look at it, are descendants of this entity
/// by `ChildOf`. A [`RasterSensor`](crate::raster::RasterSensor) draws only the descendants of the
/// nearest stage above its target, in the stage's own coordinates. So a picture does not depend on
/// the arena's position among others. For cameras the stage's `Transform` must keep arenas further
/// apart than an agent sees.
///
/// A target outside of all stages is drawn with all other entities outside of stages, in world
/// coordinates.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
#[require(Transform, Visibility)]
pub struct Stage;

/// Returns an agent's observation in the kind of `wanted`; an agent may have sensors of both kinds.
pub(crate) fn seen_as(wanted: &ObsKind, observation: &Observation, sensor: Option<&ImageSensor>) -> ObsKind {
    let image = sensor.map(|sensor| sensor.0.shape()).filter(|shape| shape.numbers() == observation.image.len());
    let vector = ObsKind::Vector(observation.vector.len());
    match (wanted, image) {
        (ObsKind::Image(_), Some(shape)) => ObsKind::Image(shape),
        (ObsKind::Vector(_), Some(shape)) if observation.vector.is_empty() => ObsKind::Image(shape),
        _ => vector,
    }
}

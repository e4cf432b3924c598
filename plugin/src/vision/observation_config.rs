//! The kind of observation of an experiment's agents, and the sensors that it needs.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::ImageOptions;
use crate::unknown_name::UnknownName;

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

//! What the agents of an experiment see, and the sensors it takes.

use std::{fmt, str::FromStr};

use bevy::prelude::*;
use playbot_learner::ObsKind;
use serde::{Deserialize, Serialize};

use super::{ImageOptions, VisionError};
use crate::{
    game::{Game, UnknownName},
    headless_plugins::HeadlessPlugins,
    observation::VectorSensor,
    raster::RasterSensor,
};

/// What agents see. Written as its [`name`](Self::name) on the command line.
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
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Vector, Self::Raster, Self::Camera];

    /// Name on the command line and in messages.
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

/// What agents see, with the form of the pictures.
///
/// Policies and skill models from pictures carry it in their files: images of one shape can still show other things.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sight {
    /// Vector or pictures.
    pub kind: ObservationKind,
    /// Size and form of the pictures.
    pub image: ImageOptions,
}

/// How a game is drawn for agents that see pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picture {
    /// World units from the left to the right edge of what an agent sees, centred on the agent.
    pub width: f32,
}

impl fmt::Display for Sight {
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

impl Sight {
    /// Whether agents see pictures.
    pub fn is_image(&self) -> bool {
        self.kind != ObservationKind::Vector
    }

    /// What one observation of the game is.
    pub fn obs_kind(&self, game: &dyn Game) -> ObsKind {
        match self.kind {
            ObservationKind::Vector => ObsKind::Vector(game.observation().len()),
            ObservationKind::Raster | ObservationKind::Camera => self.image.obs_kind(),
        }
    }

    /// Bevy's plugins for a headless World whose agents see so.
    pub(crate) fn headless_plugins(&self) -> HeadlessPlugins {
        match self.kind {
            #[cfg(feature = "camera")]
            ObservationKind::Camera => HeadlessPlugins::drawing(),
            _ => HeadlessPlugins::default(),
        }
    }

    /// Whether it is a game's own camera that they see through.
    fn is_own_camera(&self, game: &dyn Game) -> bool {
        self.kind == ObservationKind::Camera && game.has_camera()
    }

    /// Checks the sizes, that the game can be drawn, and that this build has the sensor.
    ///
    /// # Errors
    ///
    /// See [`VisionError`].
    pub fn check(&self, game: &dyn Game) -> Result<(), VisionError> {
        if self.kind == ObservationKind::Vector {
            return Ok(());
        }
        self.image.check()?;
        if game.picture().is_none() && !self.is_own_camera(game) {
            return Err(VisionError::NoPicture { game: game.name() });
        }
        if self.kind == ObservationKind::Camera && !cfg!(feature = "camera") {
            return Err(VisionError::NoCamera);
        }
        Ok(())
    }

    /// Adds what the sensors need to an app, before it is finished.
    ///
    /// # Errors
    ///
    /// See [`VisionError`].
    pub(crate) fn build(&self, game: &dyn Game, app: &mut App) -> Result<(), VisionError> {
        self.check(game)?;
        match self.kind {
            ObservationKind::Vector => return Ok(()),
            ObservationKind::Raster => app.add_plugins(crate::raster::RasterPlugin),
            #[cfg(feature = "camera")]
            ObservationKind::Camera => app.add_plugins(crate::camera::CameraSensorPlugin::for_app(app)?),
            #[cfg(not(feature = "camera"))]
            ObservationKind::Camera => return Err(VisionError::NoCamera),
        };
        if !self.is_own_camera(game) {
            game.build_picture(app);
        }
        Ok(())
    }

    /// Gives an agent the sensor. One that sees pictures needs no vector, which costs time to fill.
    pub(crate) fn equip(&self, game: &dyn Game, world: &mut World, agent: Entity) {
        let mut entity = world.entity_mut(agent);
        #[cfg(feature = "camera")]
        if self.is_own_camera(game) {
            entity.insert(crate::camera::CameraSensor::of_game(self.image));
            entity.remove::<VectorSensor>();
            return;
        }
        let Some(picture) = game.picture() else { return };
        match self.kind {
            ObservationKind::Vector => return,
            ObservationKind::Raster => entity.insert(RasterSensor::following(agent, picture.width, self.image)),
            #[cfg(feature = "camera")]
            ObservationKind::Camera => {
                entity.insert(crate::camera::CameraSensor::following(agent, picture.width, self.image))
            }
            #[cfg(not(feature = "camera"))]
            ObservationKind::Camera => return,
        };
        entity.remove::<VectorSensor>();
    }
}

//! Sensors for the agents of a game, built from an experiment's observation settings.

use crate::game::Game;
use bevy::prelude::*;
use bevy_playbot::{
    headless::HeadlessPlugins,
    observation::VectorSensor,
    raster::{RasterPlugin, RasterSensor},
    vision::{ObservationConfig, ObservationKind, VisionError},
};
use playbot_learner::ObsKind;

/// Sensors of an [`ObservationConfig`] in a particular game.
pub trait GameSensors {
    /// Returns the form of an observation: its length, or the shape of its pictures.
    fn obs_kind(&self, game: &dyn Game) -> ObsKind;

    /// Checks the sizes, that the game can be drawn, and that this build has the sensor.
    ///
    /// # Errors
    ///
    /// See [`VisionError`].
    fn check(&self, game: &dyn Game) -> Result<(), VisionError>;

    /// Adds what the sensors need to an app, before it is finished.
    ///
    /// # Errors
    ///
    /// See [`VisionError`].
    fn build(&self, game: &dyn Game, app: &mut App) -> Result<(), VisionError>;

    /// Returns Bevy's plugins for a headless World with these sensors.
    fn headless_plugins(&self) -> HeadlessPlugins;

    /// Returns whether the sensors use the game's own camera.
    fn is_own_camera(&self, game: &dyn Game) -> bool;

    /// Gives an agent the sensor. Agents with pictures get no vector, which costs time to fill.
    fn equip(&self, game: &dyn Game, world: &mut World, agent: Entity);
}

impl GameSensors for ObservationConfig {
    fn obs_kind(&self, game: &dyn Game) -> ObsKind {
        match self.kind {
            ObservationKind::Vector => ObsKind::Vector(game.observation().len()),
            ObservationKind::Raster | ObservationKind::Camera => self.image.obs_kind(),
        }
    }

    fn check(&self, game: &dyn Game) -> Result<(), VisionError> {
        if self.kind == ObservationKind::Vector {
            return Ok(());
        }
        self.image.check()?;
        if game.tools().pictures.picture().is_none() && !self.is_own_camera(game) {
            return Err(VisionError::NoPicture { game: game.name() });
        }
        if self.kind == ObservationKind::Camera && !cfg!(feature = "camera") {
            return Err(VisionError::NoCamera);
        }
        Ok(())
    }

    fn build(&self, game: &dyn Game, app: &mut App) -> Result<(), VisionError> {
        self.check(game)?;
        match self.kind {
            ObservationKind::Vector => return Ok(()),
            ObservationKind::Raster => app.add_plugins(RasterPlugin),
            #[cfg(feature = "camera")]
            ObservationKind::Camera => app.add_plugins(bevy_playbot::camera::CameraSensorPlugin::for_app(app)?),
            #[cfg(not(feature = "camera"))]
            ObservationKind::Camera => return Err(VisionError::NoCamera),
        };
        if !self.is_own_camera(game) {
            game.tools().pictures.build_picture(app);
        }
        Ok(())
    }

    fn headless_plugins(&self) -> HeadlessPlugins {
        match self.kind {
            #[cfg(feature = "camera")]
            ObservationKind::Camera => HeadlessPlugins::drawing(),
            _ => HeadlessPlugins::default(),
        }
    }

    fn is_own_camera(&self, game: &dyn Game) -> bool {
        self.kind == ObservationKind::Camera && game.tools().pictures.has_camera()
    }

    fn equip(&self, game: &dyn Game, world: &mut World, agent: Entity) {
        let mut entity = world.entity_mut(agent);
        #[cfg(feature = "camera")]
        if self.is_own_camera(game) {
            entity.insert(bevy_playbot::camera::CameraSensor::of_game(self.image));
            entity.remove::<VectorSensor>();
            return;
        }
        let Some(width) = game.tools().pictures.picture().map(|picture| picture.width_on(&self.image)) else { return };
        match self.kind {
            ObservationKind::Vector => return,
            ObservationKind::Raster => entity.insert(RasterSensor::following(agent, width, self.image)),
            #[cfg(feature = "camera")]
            ObservationKind::Camera => {
                entity.insert(bevy_playbot::camera::CameraSensor::following(agent, width, self.image))
            }
            #[cfg(not(feature = "camera"))]
            ObservationKind::Camera => return,
        };
        entity.remove::<VectorSensor>();
    }
}

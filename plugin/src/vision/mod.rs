//! Agents that see pictures.
//!
//! | part | what it is |
//! |---|---|
//! | [`ImageSensor`] | size and form of the pictures an agent's policy reads |
//! | [`Frame`] | the RGB picture of this tick, stamped with it, from whichever sensor |
//! | [`Stage`] | the root of an arena that is drawn by itself |
//! | [`TileLayer`] | a grid of tiles, drawn at once |
//!
//! A sensor fills [`Frame`] in [`VisionSystems::Look`]; [`VisionSystems::Compose`] checks its tick and makes
//! [`Observation::image`](crate::observation::Observation::image) of it. Agents that nobody decides for, and agents between
//! two episodes, are not looked after.

mod blank;
mod card;
mod compose;
mod difference;
mod frame;
mod observation_config;
mod options;
mod planes;
mod plugin;
mod sprite_image;
mod stack;
mod stage;
mod tile_layer;
mod velocity;

pub use blank::BlankEpisodes;
pub use card::UnknownObservation;
pub use difference::{CLOSE, Difference};
pub use frame::Frame;
pub use observation_config::{ObservationConfig, ObservationKind, Picture};
pub use options::{ImageOptions, ImageSensor, MAX_SIDE, VisionError};
pub use plugin::VisionPlugin;
pub use stage::Stage;
pub use tile_layer::TileLayer;
pub use velocity::PaintedVelocity;

pub(crate) use compose::is_observed;
pub(crate) use sprite_image::{NO_IMAGE, lacks_image};

use bevy::ecs::schedule::SystemSet;

/// Parts of [`ObserveSchedule`](crate::systems::ObserveSchedule) for agents that see pictures, in this order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VisionSystems {
    /// The game brings what is drawn up to date: transforms, sprites, tiles.
    Dress,
    /// Sensors fill each agent's [`Frame`].
    Look,
    /// The frame's tick is checked, and the observation made of it.
    Compose,
}

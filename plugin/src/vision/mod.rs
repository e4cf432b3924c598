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
//! tick and makes [`Observation::image`](crate::observation::Observation::image) from it. Idle
//! agents and agents between two episodes are skipped.
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

mod blank;
mod card;
mod check_images;
mod compose;
mod difference;
mod frame;
mod observation_config;
mod options;
mod planes;
mod plugin;
mod seen_as;
mod sprite_image;
mod stack;
mod stage;
mod systems;
mod tile_layer;
mod velocity;

pub use card::UnknownObservation;
pub use frame::Frame;
pub use observation_config::{ObservationConfig, ObservationKind, Picture};
pub use options::{ImageOptions, ImageSensor, MAX_SIDE, VisionError};
pub use stage::Stage;
pub use systems::VisionSystems;
pub use tile_layer::TileLayer;
pub use velocity::PaintedVelocity;

// For playbot_lab, playbot_cli and tests; games need none of it.
#[doc(hidden)]
pub use blank::BlankEpisodes;
#[doc(hidden)]
pub use difference::{CLOSE, Difference};
#[doc(hidden)]
pub use plugin::VisionPlugin;

pub(crate) use check_images::check_images;
pub(crate) use compose::is_observed;
pub(crate) use seen_as::seen_as;
pub(crate) use sprite_image::{NO_IMAGE, lacks_image};

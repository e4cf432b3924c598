//! Pictures of 2D sprites drawn on the CPU.
//!
//! A [`RasterSensor`] draws the picture of Bevy's sprite renderer on a camera with nearest
//! sampling, without multisampling and tonemapping. The background is Bevy's
//! [`ClearColor`](bevy::prelude::ClearColor), or black without one. It draws:
//!
//! - [`Sprite`](bevy::prelude::Sprite) with image or atlas, tint, flips, rectangle, `custom_size`, [`Anchor`](bevy::sprite::Anchor) and the image
//!   modes `Auto` and `Scale`, and [`TileLayer`](crate::vision::TileLayer);
//! - with the [`Transform`](bevy::prelude::Transform) and [`Visibility`](bevy::prelude::Visibility)
//!   of entities and their parents; the [`GlobalTransform`](bevy::prelude::GlobalTransform) is not
//!   read and need not be kept;
//! - the farthest z first. At equal z, parents come first and then the order of their
//!   [`Children`](bevy::prelude::Children). Bevy leaves this open, so give overlapping entities
//!   different z.
//!
//! Texels of half alpha are mixed in linear light. The centre of a pixel selects the texel that it
//! shows. Only sums, products and quotients in a fixed order are used, so a picture has the same
//! bytes on every machine.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{prelude::*, raster::{RasterPlugin, RasterSensor}, vision::ImageOptions};
//!
//! let mut app = headless_app();
//! app.add_plugins(RasterPlugin);
//! let red = Sprite::from_color(Color::srgb(1.0, 0.0, 0.0), Vec2::splat(2.0));
//! let player = app.world_mut().spawn((red, Transform::default())).id();
//! // Four units of the world around the player, one pixel per unit.
//! let sensor = RasterSensor::following(player, 4.0, ImageOptions { width: 4, height: 4, ..default() });
//! let agent = app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human, sensor)).id();
//! app.tick().expect("it can be drawn");
//! let red = &app.world().get::<Observation>(agent).expect("every agent has one").image[..16];
//! assert_eq!(red, [0, 0, 0, 0, 0, 255, 255, 0, 0, 255, 255, 0, 0, 0, 0, 0]);
//! ```

mod canvas;
mod colour;
mod error;
mod plugin;
mod pose;
mod quad;
mod renderer;
mod scene;
mod sensor;
mod sprite;
mod texture;
mod tiles;

pub use plugin::RasterPlugin;
pub use sensor::RasterSensor;

//! Pictures of 2D sprites drawn on the CPU.
//!
//! A [`RasterSensor`] draws what Bevy's sprite renderer would show on a camera with nearest sampling, without
//! multisampling and tonemapping, over Bevy's [`ClearColor`](bevy::prelude::ClearColor) if there is one and over black otherwise:
//!
//! - [`Sprite`](bevy::prelude::Sprite) with image or atlas, tint, flips, rectangle, `custom_size`, [`Anchor`](bevy::sprite::Anchor) and the image
//!   modes `Auto` and `Scale`, and [`TileLayer`](crate::vision::TileLayer);
//! - whatever [`Transform`](bevy::prelude::Transform) and [`Visibility`](bevy::prelude::Visibility) say, with those of the parents; the
//!   [`GlobalTransform`](bevy::prelude::GlobalTransform) is not read and need not be kept;
//! - the farthest z first. Things of equal z are drawn parents first and then in the order of their
//!   [`Children`](bevy::prelude::Children). Bevy leaves that to the order in which its tables hold them, so give what overlaps different z.
//!
//! Texels of half alpha are mixed in linear light. Where the centre of a pixel falls decides which texel it shows. All of
//! it is sums, products and quotients in a fixed order, so a picture has the same bytes on every machine.

mod canvas;
mod colour;
mod error;
mod look;
mod plugin;
mod pose;
mod quad;
mod scene;
mod sensor;
mod sprite;
mod texture;
mod tiles;

pub use plugin::RasterPlugin;
pub use sensor::RasterSensor;

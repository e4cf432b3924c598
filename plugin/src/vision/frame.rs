//! The picture of one tick.

use bevy::prelude::*;

/// The last picture of an agent's sensor: red, green, blue and an unused byte per pixel, top row
/// first, left to right.
///
/// Filled by a sensor. The options of [`ImageSensor`](super::ImageSensor) (grey, painted velocity,
/// stack) are applied when the observation is made from it.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component)]
pub struct Frame {
    /// `[height, width]` pixels of `[red, green, blue, 255]`.
    pub pixels: Vec<[u8; 4]>,
    /// The tick ([`Tick`](crate::tick::Tick)) of the picture; `None` before the first.
    pub tick: Option<u64>,
}

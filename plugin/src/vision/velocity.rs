//! Velocity painted into the picture.

use bevy::prelude::*;

/// The velocity that [`ImageOptions::paint_velocity`](super::ImageOptions::paint_velocity) shows, each axis divided by
/// its largest value, from -1 to 1. The game fills it before [`VisionSystems::Compose`](super::VisionSystems::Compose).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component)]
pub struct PaintedVelocity(pub Vec2);

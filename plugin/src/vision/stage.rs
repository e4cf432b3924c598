//! Arenas that are drawn by themselves.

use bevy::prelude::*;

/// The root of an arena whose inhabitants see only each other.
///
/// Everything that is drawn in the arena, and the agents that look at it, are descendants of this entity by `ChildOf`.
/// A [`RasterSensor`](crate::raster::RasterSensor) draws only what is beneath the nearest stage above its target, in the
/// stage's own coordinates, so that a picture does not depend on where the arena stands among others. For cameras the
/// stage's `Transform` must keep arenas further apart than an agent sees.
///
/// A target that is on no stage is drawn with everything else that is on none, in world coordinates.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
#[require(Transform, Visibility)]
pub struct Stage;

//! Arenas that are drawn by themselves.

use bevy::prelude::*;

/// The root of an arena whose inhabitants see only each other.
///
/// Everything that is drawn in the arena, and the agents that look at it, are descendants of this entity by `ChildOf`.
/// A [`RasterSensor`](crate::raster::RasterSensor) beneath a stage draws only what is beneath the same stage, in the
/// stage's own coordinates, so that a picture does not depend on where the arena stands among others. For cameras the
/// stage's `Transform` must keep arenas further apart than an agent sees.
///
/// Without stages, everything in the World is drawn in world coordinates.
#[derive(Component, Clone, Copy, Debug, Default)]
#[require(Transform, Visibility)]
pub struct Stage;

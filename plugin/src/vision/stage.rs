//! Arenas that are drawn separately.

use bevy::prelude::*;

/// The root of an arena whose agents see only its own contents.
///
/// All drawn entities of the arena, and the agents that look at it, are descendants of this entity
/// by `ChildOf`. A [`RasterSensor`](crate::raster::RasterSensor) draws only the descendants of the
/// nearest stage above its target, in the stage's own coordinates. So a picture does not depend on
/// the arena's position among others. For cameras the stage's `Transform` must keep arenas further
/// apart than an agent sees.
///
/// A target outside of all stages is drawn with all other entities outside of stages, in world
/// coordinates.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
#[require(Transform, Visibility)]
pub struct Stage;

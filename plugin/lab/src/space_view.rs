//! The entity that a 3D view follows, for windows of games with such a view.

use bevy::prelude::*;

/// Component of an agent: the entity that a 3D camera follows.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub struct CameraFocus(pub Entity);

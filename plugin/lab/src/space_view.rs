//! A view in space, for windows of games that have one.

use bevy::prelude::*;

/// On an agent: the entity that a camera in space follows.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub struct CameraFocus(pub Entity);

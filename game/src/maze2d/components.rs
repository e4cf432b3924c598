//! The game as entities: an arena with its level, and the ball of its agent.

use std::sync::Arc;

use bevy::prelude::*;

use super::{ball::Ball, level::Maze2dLevel, mode::Maze2dMode};

/// Map and rules of all arenas whose levels bring no rules of their own.
#[derive(Resource, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug, PartialEq)]
pub struct Maze2dRules(pub Maze2dMode);

/// One running copy of a level. With a physics context it also has [`MazePhysics`](super::physics::MazePhysics).
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
pub struct MazeArena {
    /// The level.
    #[reflect(ignore)]
    pub level: Arc<Maze2dLevel>,
    /// The rules of the level: those of the mode, unless the level brings its own.
    #[reflect(ignore)]
    pub rules: Maze2dMode,
    /// Its agent.
    pub player: Entity,
}

/// The ball of an agent. Belongs to the entity with the [`Agent`](bevy_playbot::agent::Agent).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct MazeBall(pub Ball);

/// The arena of an agent.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub struct PlaysIn(pub Entity);

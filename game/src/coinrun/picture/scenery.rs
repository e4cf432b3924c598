//! What the picture of an arena is made of, and what lies in front of what.

use bevy::prelude::*;

/// Layers, the farthest first. Things of one layer lie [`STEP`] apart in the order in which they were made.
pub const BACKDROP: f32 = -2.0;
pub const GROUND: f32 = -1.0;
pub const BLOCKS: f32 = 0.0;
pub const ACTORS: f32 = 1.0;
pub const STEP: f32 = 1.0 / 1024.0;

/// Height of a player's picture in heights of its body; its feet are at the body's.
pub const PLAYER_HEIGHT: f32 = 1.7415;

/// What belongs to the picture of an arena, and the tick that it shows.
#[derive(Component, Reflect)]
#[reflect(Component)]
pub struct Scenery {
    pub backdrop: Entity,
    pub ground: Entity,
    /// Number of bodies that have been given a place in front of one another.
    pub placed: u32,
    /// Tick of the episode.
    pub tick: u32,
}

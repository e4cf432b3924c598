//! Parts of an arena's picture, and the order of its layers.

use bevy::prelude::*;

/// Layers, the farthest first. Entities of one layer lie [`STEP`] apart in creation order.
pub const BACKDROP: f32 = -2.0;
pub const GROUND: f32 = -1.0;
pub const BLOCKS: f32 = 0.0;
pub const ACTORS: f32 = 1.0;
pub const STEP: f32 = 1.0 / 1024.0;

/// Height of a player's picture in heights of its body; its feet are at the body's.
pub const PLAYER_HEIGHT: f32 = 1.7415;

/// Marks parts of an arena's picture, with the tick that it shows.
#[derive(Component, Reflect)]
#[reflect(Component)]
pub struct Scenery {
    /// The picture behind everything.
    pub backdrop: Entity,
    /// The layer of tiles.
    pub ground: Entity,
    /// Number of bodies that have a depth.
    pub placed: u32,
    /// Tick of the episode.
    pub tick: u32,
}

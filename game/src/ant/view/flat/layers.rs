//! Width of the picture, and order of its layers.

/// Metres from the left to the right edge of an agent's picture: four cells of a maze.
pub const VIEW: f32 = 16.0;

/// Layers, the farthest first.
pub const GROUND: f32 = -2.0;
pub const GOAL: f32 = -1.0;
pub const LIMBS: f32 = 0.0;

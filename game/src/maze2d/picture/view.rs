//! Width of the picture.

/// Width of an agent's view, in world units, and the least height: the longer side of the maze, so that all of it is
/// visible in any shape of the picture.
pub const VIEW: f32 = 12.0;

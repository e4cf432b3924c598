//! How wide the picture is.

/// Width of what an agent sees, in world units: the longer side of the maze.
pub const VIEW: f32 = 12.0;

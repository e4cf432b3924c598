//! How wide the picture is.

/// Width of what an agent sees, in world units, and the least height: the longer side of the maze, so that the whole of it is
/// seen, whatever the shape of the picture.
pub const VIEW: f32 = 12.0;

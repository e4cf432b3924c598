//! How much of a level an agent sees.

/// Tiles from the left to the right edge of what an agent sees.
pub const VIEW: f32 = 13.0;

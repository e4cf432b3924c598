//! Size of an agent's view of a level.

/// Tiles from the left to the right edge of an agent's view.
pub const VIEW: f32 = 13.0;

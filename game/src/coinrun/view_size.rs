//! Range of a player's view, in tiles.

/// Tiles from the player's cell to the edge of the view.
pub const REACH: i32 = 6;
/// Width and height of the view, in tiles.
pub const SIDE: usize = 13;

//! Limits of the size of a maze.

/// Most cells to a side.
pub const MAX_SIDE: usize = 4096;
/// Most cells in all.
pub const MAX_CELLS: usize = 1 << 22;

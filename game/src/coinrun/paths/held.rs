//! The buttons of paths, and the values of each path.

/// Buttons that are tried: right and jump, right, jump, nothing, left, left and jump.
pub const HELD: [u8; 6] = [8, 7, 5, 4, 1, 2];
/// A path is followed for at most this many steps: a jump on flat ground takes 16.
pub const STEPS: u32 = 20;
/// Values per path.
pub const VALUES: usize = 6;
/// Names of the values of one path.
pub const NAMES: [&str; VALUES] = ["dies", "coin", "lands", "steps", "dx", "dy"];

//! Numbers of pictures in the original.

/// Number of background pictures that the original draws from.
pub const BACKGROUNDS: u32 = 62;
/// Number of player colours.
pub const AGENT_THEMES: u32 = 5;
/// Number of ground themes.
pub const GROUND_THEMES: u32 = 6;
/// Number of enemy sprites.
pub const ENEMY_SPRITES: u32 = 9;
/// Number of crate sprites.
pub const CRATE_SPRITES: u32 = 4;

//! The numbers of the game. Lengths are in tiles, speeds in tiles per step.

/// Number of actions of the environment.
pub const ACTIONS: u8 = 15;
/// An episode ends after this many steps.
pub const TIMEOUT: u32 = 1000;
/// Reward of the coin. There is no other reward.
pub const COIN_REWARD: f32 = 10.0;

/// The cell in which the player starts.
pub const START_CELL: [i32; 2] = [1, 1];
/// Half width of the player.
pub const PLAYER_HALF_WIDTH: f32 = 0.5;
/// Half height of the player.
pub const PLAYER_HALF_HEIGHT: f32 = 0.5787;
/// Half width and half height of saws, enemies and crates.
pub const BLOCK_HALF: f32 = 0.5;

/// Loss of vertical speed per step.
pub const GRAVITY: f32 = 0.2;
/// Vertical speed right after a jump, and the highest vertical speed.
pub const JUMP_SPEED: f32 = 1.5;
/// Horizontal speed that walking approaches.
pub const WALK_SPEED: f32 = 0.5;
/// Share of the speed difference that a supported player makes up in one step.
pub const GROUND_CONTROL: f32 = 0.2;
/// Factor on [`GROUND_CONTROL`] in the air.
pub const AIR_CONTROL: f32 = 0.15;
/// Start speed of enemies.
pub const ENEMY_SPEED: f32 = 0.15;

/// Bodies overlap only if they do so by more than this, and a body touches a tile only if it
/// reaches this far into it.
pub(in crate::coinrun) const OVERLAP_MARGIN: f32 = -0.001;
/// The corners that are tested against tiles lie at this part of the half size.
pub(in crate::coinrun) const CORNER: f32 = 0.98;
/// Margin inside its sides and below its feet for the player's support.
pub(in crate::coinrun) const FOOT_MARGIN: f32 = 0.01;

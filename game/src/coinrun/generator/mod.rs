//! Builds a level from its mode and seed, draw for draw as Procgen's CoinRun does.
//!
//! Every random decision takes one output of an mt19937 generator seeded with the level seed, so
//! the order of the draws is part of the result: a draw that is skipped or added changes the rest
//! of the level.

mod builder;
mod draw;
mod generate;
mod themes;

pub use generate::generate;
pub use themes::{AGENT_THEMES, BACKGROUNDS, CRATE_SPRITES, ENEMY_SPRITES, GROUND_THEMES};

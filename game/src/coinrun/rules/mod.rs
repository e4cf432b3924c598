//! The rules of play: pure functions over plain data.
//!
//! One step is, in this order: [`begin_step`], [`patrol`] for every enemy, [`move_player`],
//! [`touch`]. All arithmetic is f32 and in a fixed order, because standing and landing depend on
//! exact equality.

mod body;
mod constants;
mod enemy;
mod motion;
mod player;
mod state_hash;
mod touch;

pub use body::Body;
pub use constants::*;
pub use enemy::patrol;
pub(in crate::coinrun) use motion::{corners, flush, part_count};
pub(in crate::coinrun) use player::{MAX_PUSHES, directions, fall, rise_to_top, walk};
pub use player::{PlayerState, PlayerStep, begin_step, is_supported, move_player};
pub use state_hash::hash_state;
pub use touch::{Outcome, touch};

//! What defects of the games in mazes have in common: see [`bugs`](playbot_lab::bugs).

mod cells;
mod levels;
mod success;
mod variant;

pub(crate) use cells::{wall_gone_beside_the_way, walled_on_the_way};
pub(crate) use levels::of_levels;
pub(crate) use success::take_back;
pub(crate) use variant::{PLACES, pick, place, variants};

//! Shared defects of the games in mazes: see [`bugs`](playbot_lab::bugs).

mod cells;
mod levels;
mod success;
mod walls;

pub(crate) use levels::of_levels;
pub(crate) use success::take_back;
pub(crate) use walls::{ChangeMaze, of_walls};

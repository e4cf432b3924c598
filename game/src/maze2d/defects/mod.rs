//! Defects that can be planted into Maze2D, to measure testers: see [`bugs`](playbot_lab::bugs).

mod catalogue;
mod goal;
mod motion;
mod walls;

pub(super) use catalogue::defects;

//! Defects that can be planted into CoinRun, to measure which testers notice: see [`bugs`](playbot_lab::bugs).
//!
//! Those of levels change the text of a level so that it is broken by construction; those of rules are systems around
//! [`CoinRunSystems`](super::CoinRunSystems) that change what the rules read and write.

mod catalogue;
mod cells;
mod edit;
mod hazards;
mod motion;
mod out_of_reach;
mod pits;
mod player;
mod trap;
mod walls;
mod way;

pub(super) use catalogue::defects;

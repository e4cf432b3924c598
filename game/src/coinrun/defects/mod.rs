//! Defects that can be planted into CoinRun, to measure testers: see [`bugs`](playbot_lab::bugs).
//!
//! Defects of levels change the text of a level, which makes it broken by construction. Defects of rules are systems
//! around [`CoinRunSystems`](super::CoinRunSystems) that change the data which the rules read and write.

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

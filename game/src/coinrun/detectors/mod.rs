//! CoinRun's own detectors, which compare episodes with its rules for hazards, coin, enemies and ground.
//!
//! They apply the rules' own geometry to every tick, for any player.

mod catalogue;
mod coin;
mod contact;
mod inside;
mod lanes;
mod lethal;
#[cfg(test)]
mod testing;

pub(super) use catalogue::detectors;

//! Detectors of CoinRun's own: whether what its rules say about hazards, coin, enemies and ground is what
//! happens.
//!
//! They look with the rules' own geometry at every tick, whoever plays.

mod catalogue;
mod coin;
mod contact;
mod inside;
mod lanes;
mod lethal;
#[cfg(test)]
mod testing;

pub(super) use catalogue::detectors;

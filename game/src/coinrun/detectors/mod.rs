//! Detectors of CoinRun's own: whether what its rules say about hazards, coin and enemies is what happens.
//!
//! They look with the rules' own geometry at every tick, whoever plays.

mod catalogue;
mod coin;
mod contact;
mod lanes;
mod lethal;
#[cfg(test)]
mod testing;

pub(super) use catalogue::detectors;

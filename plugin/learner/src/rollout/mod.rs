//! What was played since the last update.

mod bootstrap;
mod check;
mod ends;
mod join;
mod steps;
#[cfg(test)]
mod tests;

pub use ends::EndStates;
pub use steps::{Rollout, RolloutStep};

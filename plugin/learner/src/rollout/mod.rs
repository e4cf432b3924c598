//! Rollouts: the steps played since the last update.

mod bootstrap;
mod check;
mod columns;
mod ends;
mod join;
mod steps;
#[cfg(test)]
mod tests;

pub use columns::ObsColumns;
pub use ends::EndStates;
pub use steps::{Rollout, RolloutStep};

//! Running normalisation of observations and rewards.

mod obs;
mod reward;
mod running;

pub use obs::{ObsNormalizer, ObsStats};
pub use reward::{RewardNormalizer, RewardReset};
pub use running::RunningStats;

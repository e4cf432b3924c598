//! Normalisation of observations and rewards: running, and for observations also frozen.

mod checkpoint;
mod obs;
mod reward;
mod running;

pub(crate) use checkpoint::{put_normalizers, put_obs_stats, take_normalizers, take_obs_stats};
pub use obs::{ObsNormalizer, ObsStats};
pub use reward::{RewardNormalizer, RewardReset};
pub use running::RunningStats;

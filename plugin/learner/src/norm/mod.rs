//! Running normalisation of observations and rewards.

mod checkpoint;
mod obs;
mod reward;
mod running;

pub(crate) use checkpoint::{put_normalizers, take_normalizers};
pub use obs::{ObsNormalizer, ObsStats};
pub use reward::{RewardNormalizer, RewardReset};
pub use running::RunningStats;

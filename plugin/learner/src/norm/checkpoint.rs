//! Normalisers in a checkpoint.

use super::{ObsNormalizer, RewardNormalizer, RunningStats};
use crate::FileError;
use crate::file::TensorFile;

/// Adds the state of a learner's normalisers to a file.
pub(crate) fn put_normalizers(
    file: &mut TensorFile,
    observations: Option<&ObsNormalizer>,
    rewards: Option<&RewardNormalizer>,
) {
    if let Some(normalizer) = observations {
        put_stats(file, "obs_norm", &normalizer.stats);
    }
    if let Some(normalizer) = rewards {
        put_stats(file, "reward_norm", &normalizer.stats);
        file.put_f64("reward_norm.returns", &normalizer.returns);
    }
}

/// Takes the state of a learner's normalisers out of a file.
pub(crate) fn take_normalizers(
    file: &mut TensorFile,
    observations: Option<&mut ObsNormalizer>,
    rewards: Option<&mut RewardNormalizer>,
) -> Result<(), FileError> {
    if let Some(normalizer) = observations {
        take_stats(file, "obs_norm", &mut normalizer.stats)?;
    }
    if let Some(normalizer) = rewards {
        take_stats(file, "reward_norm", &mut normalizer.stats)?;
        normalizer.returns = file.take_f64("reward_norm.returns", None)?;
    }
    Ok(())
}

fn put_stats(file: &mut TensorFile, name: &str, stats: &RunningStats) {
    file.put_f64(&format!("{name}.mean"), &stats.mean);
    file.put_f64(&format!("{name}.var"), &stats.var);
    file.put_f64(&format!("{name}.count"), &[stats.count]);
}

fn take_stats(file: &mut TensorFile, name: &str, stats: &mut RunningStats) -> Result<(), FileError> {
    let dim = stats.dim();
    stats.mean = file.take_f64(&format!("{name}.mean"), Some(dim))?;
    stats.var = file.take_f64(&format!("{name}.var"), Some(dim))?;
    stats.count = file.take_f64(&format!("{name}.count"), Some(1))?[0];
    Ok(())
}

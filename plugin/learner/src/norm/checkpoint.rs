//! Normalisers in files.

use super::{ObsNormalizer, ObsStats, RewardNormalizer, RunningStats};
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

/// Adds frozen statistics called `name` to a file.
pub(crate) fn put_obs_stats(file: &mut TensorFile, name: &str, stats: &ObsStats) {
    file.put_f64(&format!("{name}.mean"), &stats.mean);
    file.put_f64(&format!("{name}.inv_std"), &stats.inv_std);
}

/// Takes the frozen statistics of `dim` numbers called `name` out of a file.
pub(crate) fn take_obs_stats(file: &mut TensorFile, name: &str, dim: usize) -> Result<ObsStats, FileError> {
    let mean = file.take_f64(&format!("{name}.mean"), Some(dim))?;
    let inv_std = file.take_f64(&format!("{name}.inv_std"), Some(dim))?;
    let usable = |(mean, scale): (&f64, &f64)| mean.is_finite() && scale.is_finite() && *scale > 0.0;
    match mean.iter().zip(&inv_std).position(|pair| !usable(pair)) {
        None => Ok(ObsStats { mean, inv_std }),
        Some(at) => {
            let text = format!("`{name}` cannot normalise number {at}: {} · (x - {})", inv_std[at], mean[at]);
            Err(file.format(text))
        }
    }
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

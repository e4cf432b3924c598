//! Running normalisation of observations.

use super::RunningStats;

/// Added to the variance.
const EPS: f64 = 1e-8;
/// Normalised observations are clipped to ± this.
const CLIP: f64 = 10.0;

/// Mean and scale per dimension, fixed at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct ObsStats {
    pub(crate) mean: Vec<f64>,
    pub(crate) inv_std: Vec<f64>,
}

impl ObsStats {
    /// Adds the normalised `observation` to the end of `out`: clip((x - mean)/√(var + 1e-8), ±10).
    pub fn normalize_into(&self, observation: &[f32], out: &mut Vec<f32>) {
        let dims = observation.iter().zip(&self.mean).zip(&self.inv_std);
        out.extend(dims.map(|((&x, m), s)| ((f64::from(x) - m) * s).clamp(-CLIP, CLIP) as f32));
    }
}

/// Keeps the running mean and variance of observations.
#[derive(Clone, Debug, PartialEq)]
pub struct ObsNormalizer {
    /// Everything seen so far.
    pub stats: RunningStats,
}

impl ObsNormalizer {
    /// Nothing seen yet.
    pub fn new(dim: usize) -> Self {
        Self { stats: RunningStats::new(dim) }
    }

    /// Takes in rows of observations.
    pub fn update(&mut self, rows: &[f32]) {
        let n = rows.len() / self.stats.dim().max(1);
        self.stats.update(rows.iter().map(|&x| f64::from(x)), n);
    }

    /// The present mean and scale.
    pub fn snapshot(&self) -> ObsStats {
        ObsStats {
            mean: self.stats.mean.clone(),
            inv_std: self.stats.var.iter().map(|v| 1.0 / (v + EPS).sqrt()).collect(),
        }
    }
}

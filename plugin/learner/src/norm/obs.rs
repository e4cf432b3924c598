//! Normalisation of observations: frozen, or running.

use super::RunningStats;

/// Added to the variance.
const EPS: f64 = 1e-8;
/// Bound to which normalised observations are clipped.
const CLIP: f64 = 10.0;
/// Deviation below which a dimension counts as constant.
const CONSTANT: f64 = 1e-3;

/// Mean and scale per dimension, fixed.
#[derive(Clone, Debug, PartialEq)]
pub struct ObsStats {
    pub(crate) mean: Vec<f64>,
    pub(crate) inv_std: Vec<f64>,
}

impl ObsStats {
    /// Computes mean and deviation of all `rows` of `dim` numbers, the same on any number of threads.
    ///
    /// A dimension that deviates by less than 1e-3 counts as constant and is only centred, since its scale is
    /// unknown. A value that the rows do not hold keeps its distance from the mean.
    pub(crate) fn of<'a>(rows: impl Iterator<Item = &'a [f32]> + Clone, dim: usize) -> Self {
        let sums = |add: &dyn Fn(usize, f64) -> f64| {
            let (mut sums, mut n) = (vec![0.0; dim], 0u64);
            for row in rows.clone() {
                sums.iter_mut().zip(row).enumerate().for_each(|(d, (sum, &x))| *sum += add(d, f64::from(x)));
                n += 1;
            }
            sums.iter_mut().for_each(|sum| *sum /= n.max(1) as f64);
            sums
        };
        let mean = sums(&|_, x| x);
        let inv_std = sums(&|d, x| (x - mean[d]).powi(2)).iter().map(|var| inverse_deviation(*var)).collect();
        Self { mean, inv_std }
    }

    /// Returns all of `rows` normalised.
    pub(crate) fn normalize(&self, rows: &[f32]) -> Vec<f32> {
        let (mut out, width) = (vec![0.0; rows.len()], self.mean.len().max(1));
        let pairs = rows.chunks_exact(width).zip(out.chunks_exact_mut(width));
        pairs.for_each(|(row, to)| self.normalize_into(row, to));
        out
    }

    /// Writes the normalised `observation` to `out`, which is as long: clip((x - mean) / deviation, ±10).
    pub fn normalize_into(&self, observation: &[f32], out: &mut [f32]) {
        let dims = observation.iter().zip(&self.mean).zip(&self.inv_std);
        for (to, ((&x, m), s)) in out.iter_mut().zip(dims) {
            *to = ((f64::from(x) - m) * s).clamp(-CLIP, CLIP) as f32;
        }
    }
}

/// Returns 1/√var, or 1 for a nearly constant dimension.
fn inverse_deviation(var: f64) -> f64 {
    let deviation = var.sqrt();
    if deviation < CONSTANT { 1.0 } else { 1.0 / deviation }
}

/// Keeps the running mean and variance of observations.
#[derive(Clone, Debug, PartialEq)]
pub struct ObsNormalizer {
    /// Statistics of all observations so far.
    pub stats: RunningStats,
}

impl ObsNormalizer {
    /// Creates a normaliser without data.
    pub fn new(dim: usize) -> Self {
        Self { stats: RunningStats::new(dim) }
    }

    /// Adds rows of observations.
    pub fn update(&mut self, rows: &[f32]) {
        let n = rows.len() / self.stats.dim().max(1);
        self.stats.update(rows.iter().map(|&x| f64::from(x)), n);
    }

    /// Returns the present mean and scale 1/√(var + 1e-8).
    pub fn snapshot(&self) -> ObsStats {
        ObsStats {
            mean: self.stats.mean.clone(),
            inv_std: self.stats.var.iter().map(|v| 1.0 / (v + EPS).sqrt()).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frozen_statistics_by_hand() {
        // The second dimension is constant, the third nearly so.
        let rows = [[1.0, 60.0, 0.5], [5.0, 60.0, 0.5002], [3.0, 60.0, 0.5001], [7.0, 60.0, 0.4997]];
        let stats = ObsStats::of(rows.iter().map(<[f32; 3]>::as_slice), 3);
        let got = stats.normalize(&[6.0, 60.0, 0.5, -400.0, 63.0, 1.5]);
        // Mean 4, variance 5.
        let want = [2.0 / 5.0f32.sqrt(), 0.0, 0.0, -10.0, 3.0, 1.0];
        assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() < 1e-4), "{got:?}, expected {want:?}");
        assert_eq!(ObsStats::of(std::iter::empty(), 2).normalize(&[3.0, -4.0]), [3.0, -4.0]);
    }
}

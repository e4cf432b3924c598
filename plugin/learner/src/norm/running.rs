//! Running mean and variance.

/// Mean and variance of all rows so far, per dimension (Chan et al.'s parallel update).
///
/// Starts at mean 0, variance 1 and a count of 1e-4, which the first batch outweighs.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningStats {
    /// Mean per dimension.
    pub mean: Vec<f64>,
    /// Biased variance per dimension.
    pub var: Vec<f64>,
    /// Rows seen, plus 1e-4.
    pub count: f64,
}

impl RunningStats {
    /// Creates statistics without data.
    pub fn new(dim: usize) -> Self {
        Self { mean: vec![0.0; dim], var: vec![1.0; dim], count: 1e-4 }
    }

    /// Returns the number of dimensions.
    pub fn dim(&self) -> usize {
        self.mean.len()
    }

    /// Adds a batch of rows, row-major. Incomplete rows at the end are ignored.
    pub fn update(&mut self, rows: impl Iterator<Item = f64> + Clone, n: usize) {
        let dim = self.dim();
        if n == 0 || dim == 0 {
            return;
        }
        let count = n as f64;
        let mut mean = vec![0.0; dim];
        for (i, x) in rows.clone().take(n * dim).enumerate() {
            mean[i % dim] += x;
        }
        mean.iter_mut().for_each(|m| *m /= count);
        let mut var = vec![0.0; dim];
        for (i, x) in rows.take(n * dim).enumerate() {
            var[i % dim] += (x - mean[i % dim]).powi(2);
        }
        let total = self.count + count;
        for d in 0..dim {
            let delta = mean[d] - self.mean[d];
            let spread = var[d] + self.var[d] * self.count + delta * delta * self.count * count / total;
            self.mean[d] += delta * count / total;
            self.var[d] = spread / total;
        }
        self.count = total;
    }
}

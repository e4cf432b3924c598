//! The frozen decoder's side of the penalty: its distributions and α for the rows that an update reads.

use crate::nn::{Dist, HostDist, vector};
use burn::tensor::{Device, Tensor};

/// What the decoder says about many rows, in host memory.
#[derive(Clone, Debug)]
pub(crate) struct DecoderRows {
    /// The decoder's distributions, as the policy's are compared with them.
    pub(crate) dist: HostDist,
    /// α of each row.
    pub(crate) alpha: Vec<f32>,
}

/// The frozen decoder's side of a minibatch.
#[derive(Clone, Debug)]
pub struct DecoderBatch {
    /// Its distributions.
    pub dist: Dist,
    /// α of each row, `[n]`.
    pub alpha: Tensor<1>,
    /// Mean of α.
    pub alpha_mean: f64,
}

impl DecoderRows {
    /// The given rows as constants on `device`.
    pub(crate) fn batch(&self, rows: &[usize], device: &Device) -> DecoderBatch {
        let alpha: Vec<f32> = rows.iter().map(|&r| self.alpha[r]).collect();
        let sum: f64 = alpha.iter().map(|&a| f64::from(a)).sum();
        DecoderBatch {
            dist: self.dist.rows(rows, device),
            alpha_mean: sum / alpha.len() as f64,
            alpha: vector(alpha, device),
        }
    }
}

//! A rollout made ready for its update, and the minibatches taken from it.

use super::{PpoBatch, Rollout, normalize_advantages};
use crate::Actions;
use crate::nn::{ActionRows, Dist, HostDist, matrix, vector};
use crate::norm::ObsStats;
use crate::policy::joined_rows;
use burn::tensor::{Device, Tensor};

/// The frozen decoder's side of a rollout.
#[derive(Debug)]
pub(super) struct DecoderRows {
    /// The decoder's distributions.
    pub(super) dist: HostDist,
    /// α of each row.
    pub(super) alpha: Vec<f32>,
}

/// Everything an update reads, one entry per row.
#[derive(Debug)]
pub(super) struct Prepared<'a> {
    pub(super) rollout: &'a Rollout,
    pub(super) advantages: Vec<f32>,
    pub(super) returns: Vec<f32>,
    pub(super) decoder: Option<DecoderRows>,
    /// How many of the rollout's skill numbers the networks read: all or none.
    pub(super) latent: usize,
    pub(super) stats: Option<ObsStats>,
    pub(super) norm_adv: bool,
}

/// One minibatch on the device.
#[derive(Clone, Debug)]
pub struct Minibatch {
    /// What actor and critic read, `[n, latent + obs_dim]`.
    pub inputs: Tensor<2>,
    /// Constants of the PPO loss.
    pub ppo: PpoBatch,
    /// Constants of the penalty, if there is one.
    pub decoder: Option<DecoderBatch>,
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

impl Prepared<'_> {
    pub(super) fn minibatch(&self, rows: &[usize], device: &Device) -> Minibatch {
        let rollout = self.rollout;
        let pick = |values: &[f32]| -> Vec<f32> { rows.iter().map(|&r| values[r]).collect() };
        let inputs = joined_rows(
            &rollout.z,
            self.latent,
            &rollout.obs,
            rollout.obs_dim,
            self.stats.as_ref(),
            rows.iter().copied(),
        );
        let mut advantages = pick(&self.advantages);
        if self.norm_adv {
            normalize_advantages(&mut advantages);
        }
        let actions: Actions = rollout.actions.gather(rows);
        Minibatch {
            inputs: matrix(inputs, rows.len(), self.latent + rollout.obs_dim, device),
            ppo: PpoBatch {
                actions: ActionRows::new(&actions, device),
                old_log_probs: vector(pick(&rollout.log_probs), device),
                advantages: vector(advantages, device),
                old_values: vector(pick(&rollout.values), device),
                returns: vector(pick(&self.returns), device),
            },
            decoder: self.decoder.as_ref().map(|decoder| {
                let alpha = pick(&decoder.alpha);
                let sum: f64 = alpha.iter().map(|&a| f64::from(a)).sum();
                DecoderBatch {
                    dist: decoder.dist.rows(rows, device),
                    alpha_mean: sum / alpha.len() as f64,
                    alpha: vector(alpha, device),
                }
            }),
        }
    }
}

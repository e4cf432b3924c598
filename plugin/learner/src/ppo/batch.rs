//! A rollout made ready for its update, and the minibatches taken from it.

use super::{PpoBatch, normalize_advantages};
use crate::nn::{ActionRows, vector};
use crate::norm::ObsStats;
use crate::policy::{HostStates, NetInput};
use crate::score::{DecoderBatch, DecoderRows};
use crate::{Actions, Rollout};
use burn::tensor::Device;
use std::sync::Arc;

/// Everything an update reads, one entry per row.
#[derive(Debug)]
pub(super) struct Prepared<'a> {
    pub(super) rollout: &'a Rollout,
    pub(super) advantages: Vec<f32>,
    pub(super) returns: Vec<f32>,
    pub(super) decoder: Option<DecoderRows>,
    /// How many of the rollout's skill numbers the networks read: all or none.
    pub(super) latent: usize,
    pub(super) stats: Option<Arc<ObsStats>>,
    pub(super) norm_adv: bool,
}

/// One minibatch on the device.
#[derive(Clone, Debug)]
pub struct Minibatch {
    /// What actor and critic read.
    pub inputs: NetInput,
    /// Constants of the PPO loss.
    pub ppo: PpoBatch,
    /// Constants of the penalty, if there is one.
    pub decoder: Option<DecoderBatch>,
}

impl Prepared<'_> {
    pub(super) fn minibatch(&self, rows: &[usize], device: &Device) -> Minibatch {
        let rollout = self.rollout;
        let pick = |values: &[f32]| -> Vec<f32> { rows.iter().map(|&r| values[r]).collect() };
        let states = HostStates {
            z: &rollout.z,
            latent: self.latent,
            obs: rollout.obs.as_slice(),
            kind: &rollout.obs_kind,
            stats: self.stats.as_deref(),
        };
        let mut advantages = pick(&self.advantages);
        if self.norm_adv {
            normalize_advantages(&mut advantages);
        }
        let actions: Actions = rollout.actions.gather(rows);
        Minibatch {
            inputs: states.input(rows, device),
            ppo: PpoBatch {
                actions: ActionRows::new(&actions, device),
                old_log_probs: vector(pick(&rollout.log_probs), device),
                advantages: vector(advantages, device),
                old_values: vector(pick(&rollout.values), device),
                returns: vector(pick(&self.returns), device),
            },
            decoder: self.decoder.as_ref().map(|decoder| decoder.batch(rows, device)),
        }
    }
}

//! Transitions from the replay buffer, made ready for a gradient step.

use super::SacLearner;
use crate::nn::{ActionRows, matrix, vector};
use crate::policy::joined_rows;
use crate::rng::{ChaCha8Rng, normal};
use crate::score::{DecoderBatch, present_stats};
use crate::{ActionSpace, LearnError};
use burn::tensor::Tensor;

/// One batch of transitions on the device.
#[derive(Clone, Debug)]
pub struct SacBatch {
    /// What the actor reads, `[n, latent + obs_dim]`.
    pub inputs: Tensor<2>,
    /// The actions taken.
    pub actions: ActionRows,
    /// What they earned, `[n]`.
    pub rewards: Tensor<1>,
    /// 1 where the value of the next state counts, 0 where the episode was over, `[n]`.
    pub continues: Tensor<1>,
    /// The next states as the actor reads them, `[n, latent + obs_dim]`; any numbers where they do not count.
    pub next_inputs: Tensor<2>,
    /// Constants of the penalty, if there is one.
    pub decoder: Option<DecoderBatch>,
}

impl SacLearner {
    /// Standard normal numbers for a batch of draws; discrete actions need none.
    pub(super) fn noise(&self, rng: &mut ChaCha8Rng) -> Option<Tensor<2>> {
        let ActionSpace::Continuous(dim) = self.spec.action_space else { return None };
        let n = self.config.batch;
        Some(matrix((0..n * dim).map(|_| normal(rng)).collect(), n, dim, &self.device.plain()))
    }

    /// The transitions in `slots` on the device, normalised; with the decoder's side of them if the actor needs it.
    pub(super) fn batch(&self, slots: &[usize], with_actor: bool) -> Result<SacBatch, LearnError> {
        let (buffer, device, n) = (&self.buffer, self.device.plain(), slots.len());
        let stats = present_stats(self.skill.as_ref(), self.observations.as_ref());
        let (latent, obs_dim) = (self.spec.latent, buffer.obs_dim);
        let inputs = |z: &[f32], obs: &[f32]| {
            let rows = slots.iter().copied();
            let rows = joined_rows(z, latent, obs, obs_dim, stats.as_deref(), rows);
            matrix(rows, n, self.inputs(), &device)
        };
        let reward = |&slot: &usize| match &self.rewards {
            Some(normalizer) => normalizer.scale(buffer.rewards[slot]),
            None => buffer.rewards[slot],
        };
        let actions = buffer.actions.gather(slots);
        let decoder = match self.skill.as_ref().filter(|_| with_actor) {
            None => None,
            Some(skill) => {
                let gather = |values: &[f32], width| joined_rows(&[], 0, values, width, None, slots.iter().copied());
                let (z, obs) = (gather(&buffer.z, buffer.latent), gather(&buffer.obs, buffer.obs_dim));
                let squashed = self.nets.actor.is_squashed();
                let mut rng = self.streams.stream("score.own_samples", self.gradient_steps);
                skill.rows((&z, &obs), &actions, squashed, &mut rng, self.device)?
            }
        };
        let all: Vec<usize> = (0..n).collect();
        let continues = slots.iter().map(|&slot| buffer.continues(slot, self.config.time_limit)).collect();
        Ok(SacBatch {
            inputs: inputs(&buffer.z, &buffer.obs),
            actions: ActionRows::new(&actions, &device),
            rewards: vector(slots.iter().map(reward).collect(), &device),
            continues: vector(continues, &device),
            next_inputs: inputs(&buffer.next_z, &buffer.next_obs),
            decoder: decoder.map(|rows| rows.batch(&all, &device)),
        })
    }
}

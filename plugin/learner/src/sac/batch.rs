//! Transitions from the replay buffer, made ready for a gradient step.

use super::SacLearner;
use crate::LearnError;
use crate::nn::{ActionBatch, matrix, vector};
use crate::policy::{StateBatch, joined_rows};
use crate::score::TeacherBatch;
use burn::tensor::Tensor;

/// One batch of transitions on the device.
#[derive(Clone, Debug)]
pub struct SacBatch {
    /// What the actor reads, `[n, latent + obs_dim]`.
    pub inputs: Tensor<2>,
    /// The actions taken.
    pub actions: ActionBatch,
    /// What they earned, `[n]`.
    pub rewards: Tensor<1>,
    /// 1 where the value of the next state counts, 0 where the episode was over, `[n]`.
    pub continues: Tensor<1>,
    /// The next states as the actor reads them, `[n, latent + obs_dim]`; any numbers where they do not count.
    pub next_inputs: Tensor<2>,
    /// Constants of the penalty, if there is one.
    pub teacher: Option<TeacherBatch>,
}

impl SacLearner {
    /// Width of what the actor reads.
    pub(super) fn inputs(&self) -> usize {
        self.base.spec.latent + self.buffer.obs_dim
    }

    /// The transitions in `slots` on the device, normalised; with the teacher's side of them if the actor needs it.
    pub(super) fn batch(&self, slots: &[usize], with_actor: bool) -> Result<SacBatch, LearnError> {
        let (base, buffer, n) = (&self.base, &self.buffer, slots.len());
        let (stats, device) = (base.obs_stats(), base.device.plain());
        let (latent, obs_dim) = (base.spec.latent, buffer.obs_dim);
        let inputs = |z: &[f32], obs: &[f32]| {
            let rows = joined_rows(z, latent, obs, obs_dim, stats.as_deref(), slots);
            matrix(rows, n, self.inputs(), &device)
        };
        let reward = |&slot: &usize| match &base.rewards {
            Some(normalizer) => normalizer.scale(buffer.rewards[slot]),
            None => buffer.rewards[slot],
        };
        let actions = buffer.actions.gather(slots);
        let teacher = match base.teacher.as_ref().filter(|_| with_actor) {
            None => None,
            Some(teacher) => {
                let gather = |values: &[f32], width| joined_rows(&[], 0, values, width, None, slots);
                let (z, obs) = (gather(&buffer.z, buffer.latent), gather(&buffer.obs, buffer.obs_dim));
                let squashed = self.nets.actor.is_squashed();
                let mut rng = base.streams.stream("score.own_samples", self.gradient_steps);
                let states = StateBatch { z: &z, left: &[], obs: (&obs).into(), n };
                teacher.output(states, &actions, squashed, &mut rng, base.device)?
            }
        };
        let all: Vec<usize> = (0..n).collect();
        let continues = slots.iter().map(|&slot| buffer.continues(slot, self.config.time_limit)).collect();
        Ok(SacBatch {
            inputs: inputs(&buffer.z, &buffer.obs),
            actions: ActionBatch::new(&actions, &device),
            rewards: vector(slots.iter().map(reward).collect(), &device),
            continues: vector(continues, &device),
            next_inputs: inputs(&buffer.next_z, &buffer.next_obs),
            teacher: teacher.map(|output| output.batch(&all, &device)),
        })
    }
}

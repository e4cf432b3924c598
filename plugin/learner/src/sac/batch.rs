//! Batches of transitions from the replay buffer, prepared for a gradient step.

use crate::{
    LearnError,
    legal::{entropy_share, logit_offsets},
    nn::{ActionBatch, Dist, matrix, vector},
    policy::{StateBatch, joined_rows},
    sac::{SacLearner, buffer::ReplayBuffer},
    score::TeacherBatch,
};
use burn::tensor::Tensor;

/// One batch of transitions on the device.
#[derive(Clone, Debug)]
pub struct SacBatch {
    /// Input of the actor, `[n, latent + obs_dim]`.
    pub inputs: Tensor<2>,
    /// The actions taken.
    pub actions: ActionBatch,
    /// Their rewards, `[n]`.
    pub rewards: Tensor<1>,
    /// The remaining shares of the skills' ticks, in the states and in the next states, `[n, 1]`: only if the critics
    /// count ticks.
    pub left: Option<(Tensor<2>, Tensor<2>)>,
    /// Weight of the next state's value, usually 1, and 0 where the episode was over, `[n]`.
    pub continues: Tensor<1>,
    /// The next states as the actor reads them, `[n, latent + obs_dim]`; unspecified where they do not count.
    pub next_inputs: Tensor<2>,
    /// Constants of the penalty, if there is one.
    pub teacher: Option<TeacherBatch>,
    /// Numbers of the critics whose least value is the target; empty for all of them.
    pub seen_by_target: Vec<usize>,
    /// Numbers that are added to the logits in the states and in the next states, `[n, choices]`, if some choices are
    /// illegal: see [`Actor::forward_legal`](crate::policy::Actor::forward_legal).
    pub logit_offsets: Option<(Tensor<2>, Tensor<2>)>,
    /// The mean of the largest entropies that the legal choices allow, as a share of that of all choices: 1 without
    /// illegal ones.
    pub entropy_share: f64,
    /// The prior's distributions for states and next states, for a policy over skills: the divergence from it takes
    /// the place of the entropy.
    pub prior: Option<(Dist, Dist)>,
}

impl SacBatch {
    /// Returns the input of critics beside an action, `[n, latent + obs_dim]` or one more: [`Self::inputs`], and the
    /// remaining share.
    pub(super) fn of_critics(&self) -> Tensor<2> {
        with_clock(&self.inputs, self.left.as_ref().map(|(left, _)| left))
    }

    /// Returns the same for the next states.
    pub(super) fn next_of_critics(&self) -> Tensor<2> {
        with_clock(&self.next_inputs, self.left.as_ref().map(|(_, next)| next))
    }

    pub(super) fn offsets_of_states(&self) -> Option<&Tensor<2>> {
        self.logit_offsets.as_ref().map(|(states, _)| states)
    }

    pub(super) fn offsets_of_next(&self) -> Option<&Tensor<2>> {
        self.logit_offsets.as_ref().map(|(_, next)| next)
    }

    pub(super) fn prior_of_states(&self) -> Option<&Dist> {
        self.prior.as_ref().map(|(states, _)| states)
    }

    pub(super) fn prior_of_next(&self) -> Option<&Dist> {
        self.prior.as_ref().map(|(_, next)| next)
    }
}

/// Returns the actor's input, and behind it the column of the remaining share, if critics count ticks.
fn with_clock(inputs: &Tensor<2>, left: Option<&Tensor<2>>) -> Tensor<2> {
    match left {
        Some(left) => Tensor::cat(vec![inputs.clone(), left.clone()], 1),
        None => inputs.clone(),
    }
}

impl SacLearner {
    /// Returns the width of the actor's input.
    pub(super) fn inputs(&self) -> usize {
        self.base.spec.latent + self.buffer.widths.obs
    }

    /// Moves `buffer`, which is a batch of transitions, to the device, normalised; adds the teacher's data if the
    /// actor needs them.
    pub(super) fn batch(
        &self,
        buffer: &ReplayBuffer,
        seen_by_target: Vec<usize>,
        with_actor: bool,
    ) -> Result<SacBatch, LearnError> {
        let (base, n) = (&self.base, buffer.len());
        let all: Vec<usize> = (0..n).collect();
        let (stats, device) = (base.obs_stats(), base.device.plain());
        let (latent, obs_dim) = (base.spec.latent, buffer.widths.obs);
        let inputs = |z: &[f32], obs: &[f32]| {
            let rows = joined_rows(z, latent, obs, obs_dim, stats.as_deref(), &all);
            matrix(rows, n, self.inputs(), &device)
        };
        let reward = |&slot: &usize| match &base.rewards {
            Some(normalizer) => normalizer.scale(buffer.rewards[slot]),
            None => buffer.rewards[slot],
        };
        let teacher = match base.teacher.as_ref().filter(|_| with_actor) {
            None => None,
            Some(teacher) => {
                let squashed = self.nets.actor.is_squashed();
                let mut rng = base.streams.stream("score.own_samples", self.gradient_steps);
                let states = StateBatch { z: &buffer.z, left: &[], memory: &[], obs: (&buffer.obs).into(), n };
                teacher.output(states, (&buffer.actions, &buffer.legal), squashed, &mut rng, base.device)?
            }
        };
        let (here, next) = (inputs(&buffer.z, &buffer.obs), inputs(&buffer.next_z, &buffer.next_obs));
        let prior = base.prior_origin().map(|prior| (prior.forward(here.clone()), prior.forward(next.clone())));
        let column = |values: &[f32]| matrix(values.to_vec(), n, 1, &device);
        let left = (buffer.widths.clock > 0).then(|| (column(&buffer.left), column(&buffer.next_left)));
        let space = base.spec.action_space;
        let offsets = |legal: &[bool]| logit_offsets(legal, &all, &space, &device);
        let continues = all.iter().map(|&slot| buffer.continues(slot, self.config.time_limit)).collect();
        Ok(SacBatch {
            inputs: here,
            actions: ActionBatch::new(&buffer.actions, &device),
            rewards: vector(all.iter().map(reward).collect(), &device),
            left,
            continues: vector(continues, &device),
            next_inputs: next,
            teacher: teacher.map(|output| output.batch(&all, &device)),
            logit_offsets: offsets(&buffer.legal).zip(offsets(&buffer.next_legal)),
            entropy_share: entropy_share(&buffer.legal, &space),
            prior,
            seen_by_target,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::sac::SacConfig;
    use crate::sac::buffer::demos_tests::{SPEC, episodes};

    /// Returns observations, next observations that count, and rewards of a batch of one whole episode, with
    /// observations 1, 2, 3, 4 and a reward of 1 for its last action.
    fn seen(norm_obs: bool, norm_reward: bool) -> [Vec<f32>; 3] {
        let config = SacConfig {
            norm_obs,
            norm_reward,
            gamma: 0.5,
            hidden: vec![4],
            learning_starts: 9,
            ..SacConfig::default()
        };
        let mut learner = SacLearner::new(config, SPEC, 1, DeviceKind::Flex).expect("good settings");
        let episode = episodes(1, 1.0, 0, &[0.0, 0.0, 0.0, 1.0]);
        learner.update(&episode).expect("finite");
        let drawn = learner.buffer.picked(&[0, 1, 2, 3], None).expect("one space");
        let batch = learner.batch(&drawn, Vec::new(), false).expect("finite");
        let mut next = numbers(batch.next_inputs);
        next.truncate(3);
        [numbers(batch.inputs), next, numbers(batch.rewards)]
    }

    fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
        tensor.into_data().try_to_vec().expect("floats")
    }

    fn close<const N: usize>(seen: &[f32], expected: [f32; N]) {
        assert_eq!(seen.len(), N);
        let equal = seen.iter().zip(&expected).all(|(seen, expected)| (seen - expected).abs() < 1e-2);
        assert!(equal, "{seen:?}, expected {expected:?}");
    }

    #[test]
    fn observations_are_normalised_where_that_is_wanted_and_nowhere_else() {
        let [raw, raw_next, _] = seen(false, true);
        assert_eq!((raw, raw_next), (vec![1.0, 2.0, 3.0, 4.0], vec![2.0, 3.0, 4.0]));
        let [inputs, next, _] = seen(true, false);
        // Their mean is 2.5, and their variance 1.25.
        let of = |seen: f32| (seen - 2.5) / 1.25_f32.sqrt();
        close(&inputs, [1.0, 2.0, 3.0, 4.0].map(of));
        close(&next, [2.0, 3.0, 4.0].map(of));
    }

    #[test]
    fn rewards_are_scaled_where_that_is_wanted_and_nowhere_else() {
        let [.., raw] = seen(true, false);
        assert_eq!(raw, [0.0, 0.0, 0.0, 1.0]);
        let [.., scaled] = seen(false, true);
        // Of four returns one is 1: a variance of 3/16.
        close(&scaled, [0.0, 0.0, 0.0, (16.0_f32 / 3.0).sqrt()]);
    }
}

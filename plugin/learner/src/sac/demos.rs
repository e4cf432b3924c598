//! Recordings in a replay buffer of their own.

use super::SacConfig;
use super::buffer::{ReplayBuffer, Widths};
use crate::file::TensorFile;
use crate::{ActionSpace, Actions, FileError, LearnError, PolicySpec, Rollout};

/// Recorded transitions, and their share of each batch.
#[derive(Debug)]
pub(super) struct Demos {
    pub(super) buffer: ReplayBuffer,
    pub(super) share: f64,
}

impl Demos {
    /// Creates the buffer from all transitions of `episodes`, each a rollout of one environment. Actions are clamped
    /// to [-1, 1], as the actor's are.
    ///
    /// # Errors
    /// [`LearnError::Config`] if there is nothing to learn from; else as [`Rollout::check`].
    pub(super) fn new(
        episodes: &[Rollout],
        share: f64,
        obs_dim: usize,
        space: &ActionSpace,
    ) -> Result<Self, LearnError> {
        let rows: usize = episodes.iter().map(Rollout::rows).sum();
        if rows == 0 {
            return Err(LearnError::Config("the recordings hold no steps to learn from".to_owned()));
        }
        if !episodes.iter().any(Rollout::is_rewarded) {
            let text = "the recordings hold no reward, but this algorithm learns from rewards: learn skills from them \
                        instead";
            return Err(LearnError::Config(text.to_owned()));
        }
        let mut buffer = ReplayBuffer::new(rows, Widths { obs: obs_dim, ..Widths::default() }, space);
        for episode in episodes {
            buffer.push(episode, &[])?;
        }
        if let Actions::Continuous { values, .. } = &mut buffer.actions {
            values.iter_mut().for_each(|value| *value = value.clamp(-1.0, 1.0));
        }
        Ok(Self { buffer, share })
    }

    /// Reads the recordings of a checkpoint.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen.
    pub(super) fn stored(file: &mut TensorFile, rows: u64, share: f64, spec: &PolicySpec) -> Result<Self, FileError> {
        if rows == 0 || !(share > 0.0 && share < 1.0) {
            return Err(file.format(format!("a share of {share} of each batch from {rows} recorded steps")));
        }
        let widths = Widths { obs: spec.obs.numbers(), ..Widths::default() };
        let mut buffer = ReplayBuffer::new(rows as usize, widths, &spec.action_space);
        buffer.take(file, "demos", rows)?;
        spec.action_space.check(&buffer.actions).map_err(|error| file.learner(error))?;
        Ok(Self { buffer, share })
    }

    /// Returns the number of recorded transitions in a batch.
    pub(super) fn of_batch(&self, config: &SacConfig) -> usize {
        (self.share * config.batch as f64).round() as usize
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{RlpdConfig, SacLearner};
    use super::*;
    use crate::{DeviceKind, EndStates, ObsKind};

    pub const SPEC: PolicySpec =
        PolicySpec { obs: ObsKind::Vector(1), latent: 0, action_space: ActionSpace::Discrete(2) };

    /// Returns episodes of this many environments, with observations `sign` times 1, 2, 3, ..., which end together.
    pub fn episodes(envs: usize, sign: f32, action: u32, rewards: &[f32]) -> Rollout {
        let rows = rewards.len();
        let zeros = || vec![0.0; rows];
        Rollout {
            steps: rows / envs,
            obs: (1..=rows).map(|row| sign * row as f32).collect::<Vec<f32>>().into(),
            actions: Actions::Discrete(vec![action; rows]),
            log_probs: zeros(),
            values: zeros(),
            final_values: zeros(),
            rewards: rewards.to_vec(),
            terminated: (0..rows).map(|row| row >= rows - envs).collect(),
            truncated: vec![false; rows],
            next_values: vec![0.0; envs],
            ends: EndStates { next_obs: vec![0.0; envs].into(), ..EndStates::new(&SPEC.obs) },
            ..Rollout::new(envs, SPEC.obs, 0, &SPEC.action_space)
        }
    }

    /// Returns a learner that only observes, with these recordings.
    fn looking_on(config: SacConfig, demo_share: f64, demos: &[Rollout]) -> SacLearner {
        let config = SacConfig { hidden: vec![4], learning_starts: 1000, ..config };
        let rlpd = RlpdConfig { demo_share, critics: 2, ..RlpdConfig::default() };
        SacLearner::with_demos(config, &rlpd, demos, SPEC, 1, DeviceKind::Flex).expect("good settings")
    }

    #[test]
    fn the_share_of_each_batch_is_recorded() {
        for (share, batch, expected) in [(0.5, 64, 32), (0.25, 64, 16), (0.5, 7, 4)] {
            let demos = [episodes(1, 1.0, 1, &[5.0; 4]), episodes(1, 1.0, 1, &[5.0; 6])];
            let mut learner = looking_on(SacConfig { batch, ..SacConfig::default() }, share, &demos);
            learner.update(&episodes(2, -1.0, 0, &[0.0; 8])).expect("finite");
            let mut seen: Vec<f32> = Vec::new();
            for number in 0..60 {
                let drawn = learner.draw(number).expect("played and recorded");
                let Actions::Discrete(actions) = &drawn.actions else { panic!("choices") };
                let recorded = |row: &usize| drawn.obs[*row] > 0.0;
                assert_eq!((drawn.len(), (0..batch).filter(recorded).count()), (batch, expected));
                // Observation, action and reward belong together.
                for (row, paid) in actions.iter().zip(&drawn.rewards).enumerate() {
                    let whole = if recorded(&row) { (&1, &5.0) } else { (&0, &0.0) };
                    assert_eq!(paid, whole);
                }
                seen.extend_from_slice(&drawn.obs);
            }
            seen.sort_by(f32::total_cmp);
            seen.dedup();
            let all: Vec<f32> = (-8..=6).filter(|&number| number != 0).map(|number| number as f32).collect();
            assert_eq!(seen, all, "every step is drawn some time");
        }
    }

    #[test]
    fn recorded_rewards_have_their_scale_from_the_start_and_keep_it() {
        let paid = episodes(1, 1.0, 1, &[0.0, 0.0, 0.0, 1.0]);
        let config = SacConfig { norm_reward: true, gamma: 0.5, ..SacConfig::default() };
        let mut learner = looking_on(config, 0.5, &[paid.clone(), paid]);
        let scaled = |learner: &SacLearner| learner.base.rewards.as_ref().expect("normalised").scale(1.0);
        // Six returns of 0 and two of 1 have the variance 3/16.
        assert!((scaled(&learner) - (16.0f32 / 3.0).sqrt()).abs() < 1e-3, "{}", scaled(&learner));
        learner.update(&episodes(2, -1.0, 0, &[0.0; 8])).expect("another number of environments");
        // Fourteen of 0 and two of 1: 7/64.
        assert!((scaled(&learner) - (64.0f32 / 7.0).sqrt()).abs() < 1e-3, "{}", scaled(&learner));
    }
}

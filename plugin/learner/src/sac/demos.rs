//! Recordings in a replay buffer of their own.

use super::SacConfig;
use super::buffer::ReplayBuffer;
use crate::file::TensorFile;
use crate::{ActionSpace, Actions, FileError, LearnError, PolicySpec, Rollout};

/// Recorded transitions, and how much of each batch comes from them.
#[derive(Debug)]
pub(super) struct Demos {
    pub(super) buffer: ReplayBuffer,
    pub(super) share: f64,
}

impl Demos {
    /// All transitions of `episodes`, each a rollout of one environment. Actions are held within [-1, 1], as the actor's are.
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
        if episodes.iter().flat_map(|episode| &episode.rewards).all(|&reward| reward == 0.0) {
            let text = "nothing in the recordings was ever rewarded, and this algorithm learns from their rewards; learn \
                        skills from them instead";
            return Err(LearnError::Config(text.to_owned()));
        }
        let mut buffer = ReplayBuffer::new(rows, obs_dim, 0, space);
        for episode in episodes {
            buffer.push(episode)?;
        }
        if let Actions::Continuous { values, .. } = &mut buffer.actions {
            values.iter_mut().for_each(|value| *value = value.clamp(-1.0, 1.0));
        }
        Ok(Self { buffer, share })
    }

    /// Those of a checkpoint.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen.
    pub(super) fn stored(file: &mut TensorFile, rows: u64, share: f64, spec: &PolicySpec) -> Result<Self, FileError> {
        if rows == 0 || !(share > 0.0 && share < 1.0) {
            return Err(file.format(format!("a share of {share} of each batch from {rows} recorded steps")));
        }
        let mut buffer = ReplayBuffer::new(rows as usize, spec.obs.numbers(), 0, &spec.action_space);
        buffer.take(file, "demos", rows)?;
        spec.action_space.check(&buffer.actions).map_err(|error| file.learner(error))?;
        Ok(Self { buffer, share })
    }

    /// How many of a batch's transitions are recorded ones.
    pub(super) fn of_batch(&self, config: &SacConfig) -> usize {
        (self.share * config.batch as f64).round() as usize
    }
}

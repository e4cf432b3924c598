//! What a policy reads and does, and what the end of its time means to a learner.

use crate::{ActionSpace, LearnError, ObsKind};
use serde::{Deserialize, Serialize};

/// What a policy reads and does.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub struct PolicySpec {
    /// What it observes.
    // Checkpoints of vectors were written before there were images.
    #[serde(alias = "obs_dim")]
    pub obs: ObsKind,
    /// Width of the skill before it; 0 for a policy that reads none.
    pub latent: usize,
    /// What it acts in.
    pub action_space: ActionSpace,
}

impl PolicySpec {
    /// `Ok` if there is something to read and something to do.
    ///
    /// # Errors
    /// [`LearnError::Config`] if there is not.
    pub(crate) fn validate(&self) -> Result<(), LearnError> {
        if self.obs.numbers() == 0 || self.action_space.dim() == 0 {
            return Err(LearnError::Config("observations and actions must not be empty".to_owned()));
        }
        Ok(())
    }
}

/// What a step that ran into the time limit leads to.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum TimeLimit {
    /// The value of the episode's last observation: the game would have gone on.
    Bootstrap,
    /// Nothing, as if the episode had ended by itself (the released code).
    Legacy,
}

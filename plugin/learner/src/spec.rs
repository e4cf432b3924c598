//! The inputs and outputs of a policy, and the meaning of a time limit to a learner.

use crate::{ActionSpace, LearnError, ObsKind};
use serde::{Deserialize, Serialize};

/// The inputs and outputs of a policy.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub struct PolicySpec {
    /// The kind of its observations.
    // Checkpoints of vectors were written before there were images.
    #[serde(alias = "obs_dim")]
    pub obs: ObsKind,
    /// Width of the skill before it; 0 for a policy without skills.
    pub latent: usize,
    /// Its action space.
    pub action_space: ActionSpace,
}

impl PolicySpec {
    /// Checks that it has at least one input and one action.
    ///
    /// # Errors
    /// [`LearnError::Config`] if it has not.
    pub(crate) fn validate(&self) -> Result<(), LearnError> {
        if self.obs.numbers() == 0 || self.action_space.dim() == 0 {
            return Err(LearnError::Config("observations and actions must not be empty".to_owned()));
        }
        Ok(())
    }
}

/// The value behind a step that reached the time limit.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum TimeLimit {
    /// The value of the episode's last observation: the game would have gone on.
    Bootstrap,
    /// Zero, as if the episode had ended by itself (the released code).
    Legacy,
}

//! What a policy reads and does, and what the end of its time means to a learner.

use crate::ActionSpace;
use serde::{Deserialize, Serialize};

/// What a policy reads and does.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub struct PolicySpec {
    /// Width of an observation.
    pub obs_dim: usize,
    /// Width of the skill before it; 0 for a policy that reads none.
    pub latent: usize,
    /// What it acts in.
    pub action_space: ActionSpace,
}

/// What a step that ran into the time limit leads to.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum TimeLimit {
    /// The value of the episode's last observation: the game would have gone on.
    Bootstrap,
    /// Nothing, as if the episode had ended by itself (the released code).
    Legacy,
}

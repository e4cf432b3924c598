//! Data of one tick of all agents of a World, before it joins the rollout.

use playbot_learner::{Actions, ObsKind, Observations, Policy, RolloutStep};

/// Actions and results of each agent in a tick; for the shapes see [`RolloutStep`]. Observations are kept elsewhere.
pub(super) struct AgentsTick {
    no_obs: Observations,
    pub(super) z: Vec<f32>,
    pub(super) actions: Actions,
    pub(super) log_probs: Vec<f32>,
    pub(super) values: Vec<f32>,
    pub(super) rewards: Vec<f32>,
    pub(super) terminated: Vec<bool>,
    pub(super) truncated: Vec<bool>,
}

impl AgentsTick {
    pub(super) fn new(policy: &Policy, kind: &ObsKind) -> Self {
        let empty = Vec::new;
        Self {
            no_obs: Observations::empty(kind),
            z: empty(),
            actions: Actions::empty(&policy.action_space()),
            log_probs: empty(),
            values: empty(),
            rewards: empty(),
            terminated: Vec::new(),
            truncated: Vec::new(),
        }
    }

    pub(super) fn as_step<'a>(&'a self, final_values: &'a [f32]) -> RolloutStep<'a> {
        RolloutStep {
            obs: self.no_obs.as_slice(),
            z: &self.z,
            actions: &self.actions,
            log_probs: &self.log_probs,
            values: &self.values,
            rewards: &self.rewards,
            terminated: &self.terminated,
            truncated: &self.truncated,
            final_values,
        }
    }
}

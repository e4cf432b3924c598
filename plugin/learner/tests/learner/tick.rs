//! A tick of several environments, gathered row by row as a driver plays it.

use playbot_learner::{ActionSpace, ActionValue, Actions, ObsSlice, Rollout, RolloutStep};

/// The results of every row so far.
pub struct Tick {
    actions: Actions,
    log_probs: Vec<f32>,
    rewards: Vec<f32>,
    pub terminated: Vec<bool>,
    pub truncated: Vec<bool>,
}

impl Tick {
    pub fn new(space: &ActionSpace) -> Self {
        let actions = Actions::empty(space);
        Self { actions, log_probs: Vec::new(), rewards: Vec::new(), terminated: Vec::new(), truncated: Vec::new() }
    }

    /// Adds the next row; the last three are reward, terminated and truncated.
    pub fn push(&mut self, action: &ActionValue, log_prob: f32, (reward, end, cut): (f32, bool, bool)) {
        self.actions.push(action).expect("an action of the space");
        self.log_probs.push(log_prob);
        self.rewards.push(reward);
        self.terminated.push(end);
        self.truncated.push(cut);
    }

    /// Puts the tick behind those of `rollout`; the values of final states are left to [`Rollout::bootstrap`].
    pub fn add_to(&self, rollout: &mut Rollout, obs: ObsSlice<'_>, z: &[f32], values: &[f32]) {
        let step = RolloutStep {
            obs,
            z,
            actions: &self.actions,
            log_probs: &self.log_probs,
            values,
            rewards: &self.rewards,
            terminated: &self.terminated,
            truncated: &self.truncated,
            final_values: &vec![0.0; self.rewards.len()],
        };
        rollout.push_step(step).expect("actions and observations of the rollout's kinds");
    }

    /// Returns whether the episode of a row is over.
    pub fn is_done(&self, row: usize) -> bool {
        self.terminated[row] || self.truncated[row]
    }
}

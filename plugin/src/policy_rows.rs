//! Rows of states for which a policy decides in one pass.

use playbot_learner::{LearnError, Observations, Policy, PolicyOutput};

/// The states for which a policy decides in one pass.
#[derive(Clone, Debug)]
pub struct PolicyRows {
    /// `count` observations.
    pub observations: Observations,
    /// `count` skills, one after the other; empty without skills.
    pub skills: Vec<f32>,
    /// The remaining share of each skill's ticks, this one included; empty without skills.
    pub left: Vec<f32>,
    /// Number of states.
    pub count: usize,
}

impl Default for PolicyRows {
    fn default() -> Self {
        Self { observations: Observations::Vector(Vec::new()), skills: Vec::new(), left: Vec::new(), count: 0 }
    }
}

impl PolicyRows {
    /// Returns the policy's output for the states.
    ///
    /// # Errors
    ///
    /// As [`Policy::forward_held`].
    pub fn decide(&self, policy: &Policy) -> Result<PolicyOutput, LearnError> {
        policy.forward_held(&self.skills, &self.left, &self.observations, self.count)
    }

    pub(crate) fn append(&mut self, more: &Self) -> Result<(), LearnError> {
        self.observations.push(&more.observations)?;
        self.skills.extend_from_slice(&more.skills);
        self.left.extend_from_slice(&more.left);
        self.count += more.count;
        Ok(())
    }
}

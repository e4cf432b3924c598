//! What a policy says about a batch of observations.

use crate::nn::{argmax, categorical_log_prob, gaussian_log_prob, sample_categorical, sample_gaussian};
use crate::{Action, ActionSpace, LearnError};
use rand::Rng;

/// Action distributions and values, one row per observation, in host memory.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyOutput {
    /// What the rows act in.
    pub space: ActionSpace,
    /// Normalised log-probabilities (discrete) or means (continuous), `n * dim`.
    pub head: Vec<f32>,
    /// Logarithms of the standard deviations, `n * dim`; empty if discrete.
    pub log_std: Vec<f32>,
    /// Estimated returns, `n`; zeros if the policy has no critic.
    pub values: Vec<f32>,
}

impl PolicyOutput {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Draws an action for `row` and gives its log-probability (or log-density).
    ///
    /// Takes one draw from `rng` for a discrete action, one per dimension for a continuous one.
    ///
    /// # Panics
    /// If `row` is not below [`Self::len`].
    pub fn sample<R: Rng + ?Sized>(&self, row: usize, rng: &mut R) -> (Action, f32) {
        let head = self.head(row);
        match self.space {
            ActionSpace::Discrete(_) => {
                let index = sample_categorical(head, rng);
                (Action::Discrete(index), categorical_log_prob(head, index))
            }
            ActionSpace::Continuous(_) => {
                let action = sample_gaussian(head, self.stds(row), rng);
                let log_prob = gaussian_log_prob(head, self.stds(row), &action);
                (Action::Continuous(action), log_prob)
            }
        }
    }

    /// The most likely action of `row`: the first of the most likely choices, or the mean.
    ///
    /// # Panics
    /// If `row` is not below [`Self::len`].
    pub fn greedy(&self, row: usize) -> Action {
        match self.space {
            ActionSpace::Discrete(_) => Action::Discrete(argmax(self.head(row))),
            ActionSpace::Continuous(_) => Action::Continuous(self.head(row).to_vec()),
        }
    }

    /// Log-probability (or log-density) of `action` in `row`.
    ///
    /// # Errors
    /// [`LearnError::Action`] if the action is not in the space.
    ///
    /// # Panics
    /// If `row` is not below [`Self::len`].
    pub fn log_prob(&self, row: usize, action: &Action) -> Result<f32, LearnError> {
        match (self.space, action) {
            (ActionSpace::Discrete(n), Action::Discrete(a)) if (*a as usize) < n => {
                Ok(categorical_log_prob(self.head(row), *a))
            }
            (ActionSpace::Continuous(n), Action::Continuous(a)) if a.len() == n => {
                Ok(gaussian_log_prob(self.head(row), self.stds(row), a))
            }
            (space, action) => Err(LearnError::Action(format!("{action:?} in {space:?}"))),
        }
    }

    fn head(&self, row: usize) -> &[f32] {
        let dim = self.space.dim();
        &self.head[row * dim..(row + 1) * dim]
    }

    fn stds(&self, row: usize) -> &[f32] {
        let dim = self.space.dim();
        &self.log_std[row * dim..(row + 1) * dim]
    }
}

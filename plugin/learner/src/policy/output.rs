//! The outputs of a policy for a batch of observations.

use crate::nn::{
    HostDist, argmax, categorical_log_prob, gaussian_log_prob, sample_categorical, sample_gaussian, squashed_log_prob,
    unsquashed_action,
};
use crate::{Action, ActionSpace, LearnError};
use rand::Rng;

/// Action distributions and values, one row per observation, in host memory.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyOutput {
    /// The action space of the rows.
    pub space: ActionSpace,
    /// True if a continuous action is the tanh of a normal number, which `head` and `log_std` then describe.
    pub squashed: bool,
    /// Normalised log-probabilities (discrete) or means (continuous), `n * dim`.
    pub head: Vec<f32>,
    /// Logarithms of the standard deviations, `n * dim`; empty if discrete.
    pub log_std: Vec<f32>,
    /// Estimated returns, `n`; zeros if the policy has no critic.
    pub values: Vec<f32>,
}

impl PolicyOutput {
    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Returns whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Draws an action for `row` and returns it with its log-probability (or log-density).
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
                if self.squashed {
                    let log_prob = squashed_log_prob(head, self.stds(row), &action);
                    return (Action::Continuous(squash(&action)), log_prob);
                }
                let log_prob = gaussian_log_prob(head, self.stds(row), &action);
                (Action::Continuous(action), log_prob)
            }
        }
    }

    /// Returns the most likely action of `row`: the first of the most likely choices, or the mean (squashed: its
    /// tanh, the median).
    ///
    /// # Panics
    /// If `row` is not below [`Self::len`].
    pub fn greedy(&self, row: usize) -> Action {
        match self.space {
            ActionSpace::Discrete(_) => Action::Discrete(argmax(self.head(row))),
            ActionSpace::Continuous(_) if self.squashed => Action::Continuous(squash(self.head(row))),
            ActionSpace::Continuous(_) => Action::Continuous(self.head(row).to_vec()),
        }
    }

    /// Returns the log-probability (or log-density) of `action` in `row`. A squashed action beyond ±(1 - 1e-6), where
    /// single precision cannot resolve the normal number, is clamped there; one beyond ±1 has density 0.
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
            (ActionSpace::Continuous(n), Action::Continuous(a)) if a.len() == n && self.squashed => {
                if a.iter().any(|x| x.abs() > 1.0) {
                    return Ok(f32::NEG_INFINITY);
                }
                Ok(squashed_log_prob(self.head(row), self.stds(row), &unsquash(a)))
            }
            (ActionSpace::Continuous(n), Action::Continuous(a)) if a.len() == n => {
                Ok(gaussian_log_prob(self.head(row), self.stds(row), a))
            }
            (space, action) => Err(LearnError::Action(format!("{action:?} among {space}"))),
        }
    }

    /// Splits the outputs into these numbers of rows, in order.
    ///
    /// # Panics
    /// If there are more rows in `sizes` than [`Self::len`].
    pub fn split(mut self, sizes: &[usize]) -> Vec<Self> {
        let (dim, stds) = (self.space.dim(), self.log_std.len().checked_div(self.len()).unwrap_or_default());
        let parts = sizes.iter().map(|&rows| Self {
            space: self.space,
            squashed: self.squashed,
            head: self.head.drain(..rows * dim).collect(),
            log_std: self.log_std.drain(..rows * stds).collect(),
            values: self.values.drain(..rows).collect(),
        });
        parts.collect()
    }

    /// Returns the distributions alone.
    pub(crate) fn into_dist(self) -> HostDist {
        let log_std = (!self.log_std.is_empty()).then_some(self.log_std);
        HostDist { dim: self.space.dim(), head: self.head, log_std }
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

fn squash(numbers: &[f32]) -> Vec<f32> {
    numbers.iter().map(|x| x.tanh()).collect()
}

fn unsquash(action: &[f32]) -> Vec<f32> {
    action.iter().map(|&a| unsquashed_action(a)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Streams;

    fn output(mean: f32, std: f32) -> PolicyOutput {
        PolicyOutput {
            space: ActionSpace::Continuous(1),
            squashed: true,
            head: vec![mean],
            log_std: vec![std.ln()],
            values: vec![0.0],
        }
    }

    #[test]
    fn squashed_densities_add_up_to_one() {
        let output = output(0.4, 0.7);
        let n = 20_000;
        let width = 2.0 / n as f32;
        let density = |i: usize| {
            let action = -1.0 + (i as f32 + 0.5) * width;
            f64::from(output.log_prob(0, &Action::Continuous(vec![action])).expect("fits")).exp()
        };
        let total: f64 = (0..n).map(density).sum::<f64>() * f64::from(width);
        assert!((total - 1.0).abs() < 1e-3, "{total}");
        assert_eq!(output.log_prob(0, &Action::Continuous(vec![1.5])).expect("fits"), f32::NEG_INFINITY);
    }

    #[test]
    fn squashed_draws_carry_their_own_density() {
        let output = output(-0.3, 0.5);
        let mut rng = Streams::new(1).stream("draw", 0);
        let mut below = 0;
        for _ in 0..4000 {
            let (action, log_prob) = output.sample(0, &mut rng);
            assert!((output.log_prob(0, &action).expect("fits") - log_prob).abs() < 1e-3);
            let Action::Continuous(a) = action else { panic!("continuous") };
            assert!(a[0].abs() <= 1.0);
            below += usize::from(a[0] < (-0.3f32).tanh());
        }
        assert!((1850..2150).contains(&below), "half of the draws lie below the median: {below}");
        let Action::Continuous(median) = output.greedy(0) else { panic!("continuous") };
        assert!((median[0] - (-0.3f32).tanh()).abs() < 1e-6);
    }

    #[test]
    fn gaussian_draws_carry_their_own_density_beyond_the_range_too() {
        let output = PolicyOutput { squashed: false, ..output(0.9, 0.5) };
        let mut rng = Streams::new(1).stream("draw", 0);
        let mut beyond = 0;
        for _ in 0..1000 {
            let (action, log_prob) = output.sample(0, &mut rng);
            let Action::Continuous(a) = &action else { panic!("continuous") };
            beyond += usize::from(a[0] > 1.0);
            let density = (-0.5 * ((a[0] - 0.9) / 0.5).powi(2)).exp() / (0.5 * std::f32::consts::TAU.sqrt());
            assert!((log_prob - density.ln()).abs() < 1e-4, "{a:?}");
            assert_eq!(output.log_prob(0, &action).expect("fits"), log_prob);
        }
        // P(z > 0.2) = 0.42.
        assert!((370..470).contains(&beyond), "{beyond} of 1000 lie beyond 1");
    }

    #[test]
    fn parts_are_rows_of_the_whole() {
        let whole = |rows: std::ops::Range<usize>| PolicyOutput {
            head: rows.clone().map(|row| row as f32).collect(),
            log_std: rows.clone().map(|row| -(row as f32)).collect(),
            values: rows.map(|row| 10.0 * row as f32).collect(),
            ..output(0.0, 1.0)
        };
        assert_eq!(whole(0..6).split(&[1, 0, 3, 2]), [whole(0..1), whole(1..1), whole(1..4), whole(4..6)]);
        let discrete = PolicyOutput {
            space: ActionSpace::Discrete(2),
            head: vec![1.0, 2.0, 3.0, 4.0],
            log_std: Vec::new(),
            values: vec![5.0, 6.0],
            squashed: false,
        };
        let parts = discrete.split(&[1, 1]);
        assert_eq!((&parts[1].head[..], &parts[1].values[..]), (&[3.0, 4.0][..], &[6.0][..]));
    }

    #[test]
    fn the_edge_of_a_squashed_action_has_a_finite_density() {
        let output = output(9.0, 1.0);
        assert!(output.log_prob(0, &Action::Continuous(vec![1.0])).expect("fits").is_finite());
    }
}

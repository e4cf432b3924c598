//! Policies: networks that act, networks that estimate values, and the frozen snapshot of both.
//!
//! The folder, in reading order:
//!
//! - `inputs`: inputs of networks: skills joined with observations.
//! - `entities`: the encoder of sets of things.
//! - `memory`: what policies remember from tick to tick.
//! - `actor`: the network of a distribution over actions, and the one that estimates the return.

mod actor;
mod entities;
mod inputs;
mod memory;

use crate::{
    ActionSpace, ActionValue, Choices, EntityBlock, LearnError, MixedSpace, ObsKind, ObsSlice, PolicySpec,
    device::guarded,
    legal::{held_rows, restrict},
    nn::{
        CnnKind, HostDist, ImageNet, argmax, categorical_log_prob, frozen, gaussian_log_prob, host, sample_categorical,
        sample_gaussian, squashed_log_prob, unsquashed_action, vector,
    },
    norm::ObsStats,
};
use burn::tensor::{Device, Tensor};
use playbot_kernels::{host_numbers::is_host, kept_memory::KeptWeights};
use rand::Rng;
use std::sync::Arc;

pub use crate::policy::{
    actor::{Actor, Critic, LogStd, NetShape, StdKind},
    entities::{EntityEncoder, EntityKind, SetNet},
    inputs::NetInput,
    memory::{Memory, MemoryKind, Recall},
};
pub(crate) use crate::policy::{
    actor::{ActorShape, InputWidths, StdShape},
    entities::{ENTITIES, EntityShape},
    inputs::{InputBuilder, StateBatch, joined_rows},
    memory::{BurnIn, Grid, send_rows},
};

/// Number of rows that the networks read at a time. The result of a row does not depend on the others.
pub(crate) const VECTORS_AT_A_TIME: usize = 2048;

/// The same for images, whose activations are many times as large.
const IMAGES_AT_A_TIME: usize = 256;

/// An inference snapshot of an actor and, if there is one, its critic.
///
/// Clones share the weights. A clone per thread needs no locks. A row's numbers do not depend on the other rows of
/// the batch or on the number of threads.
#[derive(Clone, Debug)]
pub struct Policy {
    pub(crate) actor: Actor,
    pub(crate) critic: Option<Critic>,
    pub(crate) stats: Option<Arc<ObsStats>>,
    spec: PolicySpec,
    device: Device,
    kept: KeptWeights,
}

impl Policy {
    /// Creates a snapshot of `actor` and `critic`, which must match `spec`.
    pub(crate) fn new(
        actor: &Actor,
        critic: Option<&Critic>,
        stats: Option<Arc<ObsStats>>,
        spec: PolicySpec,
        device: Device,
    ) -> Self {
        let (actor, critic) = (frozen(actor), critic.map(frozen));
        Self { actor, critic, stats, spec, device, kept: KeptWeights::default() }
    }

    /// Returns its inputs and outputs.
    pub fn spec(&self) -> PolicySpec {
        self.spec
    }

    /// Returns its action space.
    pub fn action_space(&self) -> ActionSpace {
        self.spec.action_space
    }

    /// Returns the width of the skill it reads; 0 if it ignores skills.
    pub fn latent(&self) -> usize {
        self.spec.latent
    }

    /// Returns the kind of its observations.
    pub fn observation(&self) -> ObsKind {
        self.spec.obs
    }

    /// Numbers in the observation it reads.
    pub fn obs_dim(&self) -> usize {
        self.spec.obs.numbers()
    }

    /// Returns whether its networks see normalised observations. Its inputs are raw all the same.
    pub fn normalises(&self) -> bool {
        self.stats.is_some()
    }

    /// Returns the share of the observations in which each value lies beyond the bound of the normaliser, ten deviations
    /// from the mean, from 0 to 1. `None` if observations are not normalised, or there are none of the right length.
    pub fn clipped_shares<'a>(&self, observations: impl Iterator<Item = &'a [f32]>) -> Option<Vec<f64>> {
        let stats = self.stats.as_ref()?;
        let (mut counts, mut rows) = (vec![0; self.obs_dim()], 0_u64);
        for row in observations.filter(|row| row.len() == counts.len()).collect::<Vec<_>>() {
            stats.count_clipped(row, &mut counts);
            rows += 1;
        }
        (rows > 0).then(|| counts.into_iter().map(|count| count as f64 / rows as f64).collect())
    }

    /// Returns whether it computes on the CPU.
    pub fn is_on_host(&self) -> bool {
        is_host(&self.device)
    }

    /// Returns the convolutions that read its images; `None` for vectors.
    pub fn cnn(&self) -> Option<CnnKind> {
        self.actor.cnn.as_ref().map(ImageNet::kind)
    }

    /// Returns the sets of things that its networks read as sets; empty if there are none, or they are read as other
    /// values.
    pub fn entities(&self) -> Vec<EntityBlock> {
        self.actor.entities.as_ref().map_or_else(Vec::new, |encoder| encoder.shape().blocks)
    }

    /// Returns the numbers that it remembers from tick to tick; 0 without memory.
    pub fn memory(&self) -> usize {
        self.actor.memory.as_ref().map_or(0, Memory::width)
    }

    /// Distributions and values for `n` observations.
    ///
    /// `z` is `n * latent` (ignored if [`Self::latent`] is 0), `obs` is `n * obs_dim`.
    ///
    /// # Errors
    /// [`LearnError::Shape`] for inputs of the wrong length; [`LearnError::Config`] for vectors in place of images,
    /// or the other way round; [`LearnError::NotFinite`] if an output is NaN or infinite.
    pub fn forward<'a>(&self, z: &[f32], obs: impl Into<ObsSlice<'a>>, n: usize) -> Result<PolicyOutput, LearnError> {
        self.forward_held(z, &[], obs, n)
    }

    /// Does [`Self::forward`] for skills with the remaining shares `left`, `n` or empty, as in
    /// [`Rollout::left`](crate::Rollout::left), for critics that count ticks.
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn forward_held<'a>(
        &self,
        z: &[f32],
        left: &[f32],
        obs: impl Into<ObsSlice<'a>>,
        n: usize,
    ) -> Result<PolicyOutput, LearnError> {
        self.forward_remembering(z, left, &[], obs, n)
    }

    /// Does [`Self::forward_held`] for agents with the memories `memory`, `n * memory()`. Without any all begin anew,
    /// with zeros. [`PolicyOutput::memory`] is what they remember afterwards.
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn forward_remembering<'a>(
        &self,
        z: &[f32],
        left: &[f32],
        memory: &[f32],
        obs: impl Into<ObsSlice<'a>>,
        n: usize,
    ) -> Result<PolicyOutput, LearnError> {
        let (mut head, mut log_std, mut values, mut after) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (space, width) = (self.spec.action_space, self.memory());
        let (dim, numbers) = (space.dim(), space.numbers());
        self.for_each_chunk(StateBatch { z, left, memory, obs: obs.into(), n }, |(x, remembered), left, rows| {
            if let Some(remembered) = remembered {
                after.extend_from_slice(&host(remembered)?[..rows * width]);
            }
            let dist = self.actor.forward(x.clone()).to_host()?;
            head.extend_from_slice(&dist.head[..rows * dim]);
            if let Some(stds) = dist.log_std {
                log_std.extend_from_slice(&stds[..rows * numbers]);
            }
            self.append_values(x, left, rows, &mut values)
        })?;
        for (name, all) in
            [("actor output", &head), ("actor log_std", &log_std), ("critic output", &values), ("actor memory", &after)]
        {
            // A log-probability may be -infinity without harm.
            if all.iter().any(|x| x.is_nan() || *x == f32::INFINITY) {
                return Err(LearnError::NotFinite { tensor: name.to_owned(), steps: None });
            }
        }
        let squashed = self.actor.is_squashed();
        Ok(PolicyOutput { space, squashed, head, log_std, values, memory: after, held: Vec::new() })
    }

    /// Returns the share of dead units in each hidden layer of the actor behind its encoder or trunk, from 0 to 1. A dead
    /// unit lets no gradient through for any of the `n` observations: a ReLU that is 0, or a tanh within 0.001 of ±1.
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn dead_units<'a>(&self, z: &[f32], obs: impl Into<ObsSlice<'a>>, n: usize) -> Result<Vec<f64>, LearnError> {
        let mut alive = Vec::new();
        let states = StateBatch { z, left: &[], memory: &[], obs: obs.into(), n };
        self.for_each_chunk(states, |(x, _), _, rows| self.actor.net.mark_alive(x, rows, &mut alive))?;
        let dead = |units: &Vec<bool>| units.iter().filter(|is_alive| !**is_alive).count() as f64 / units.len() as f64;
        Ok(alive.iter().map(dead).collect())
    }

    /// Returns only the values of [`Self::forward`]; zeros if there is no critic.
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn values<'a>(&self, z: &[f32], obs: impl Into<ObsSlice<'a>>, n: usize) -> Result<Vec<f32>, LearnError> {
        self.values_held(z, &[], obs, n)
    }

    /// Returns only the values of [`Self::forward_held`]; zeros if there is no critic.
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn values_held<'a>(
        &self,
        z: &[f32],
        left: &[f32],
        obs: impl Into<ObsSlice<'a>>,
        n: usize,
    ) -> Result<Vec<f32>, LearnError> {
        self.values_remembering(z, left, &[], obs, n)
    }

    /// Returns only the values of [`Self::forward_remembering`]; zeros if there is no critic.
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn values_remembering<'a>(
        &self,
        z: &[f32],
        left: &[f32],
        memory: &[f32],
        obs: impl Into<ObsSlice<'a>>,
        n: usize,
    ) -> Result<Vec<f32>, LearnError> {
        if self.critic.is_none() {
            return Ok(vec![0.0; n]);
        }
        let mut values = Vec::with_capacity(n);
        let states = StateBatch { z, left, memory, obs: obs.into(), n };
        self.for_each_chunk(states, |(x, _), left, rows| self.append_values(x, left, rows, &mut values))?;
        Ok(values)
    }

    /// Adds the values of the first `rows` joined inputs.
    fn append_values(
        &self,
        x: Tensor<2>,
        left: Option<Tensor<1>>,
        rows: usize,
        values: &mut Vec<f32>,
    ) -> Result<(), LearnError> {
        match &self.critic {
            Some(critic) => values.extend_from_slice(&host(critic.forward(x, left))?[..rows]),
            None => values.resize(values.len() + rows, 0.0),
        }
        Ok(())
    }

    /// Calls `read` with the joined inputs of some states at a time and what is remembered after them, the remaining
    /// shares of their skills, and their number, until all were read.
    ///
    /// They have at least two rows, see [`Actor::remember`].
    fn for_each_chunk(
        &self,
        states: StateBatch<'_>,
        mut read: impl FnMut((Tensor<2>, Option<Tensor<2>>), Option<Tensor<1>>, usize) -> Result<(), LearnError>,
    ) -> Result<(), LearnError> {
        let StateBatch { z, left, memory, obs, n } = states;
        if n == 0 {
            return Ok(());
        }
        let PolicySpec { obs: kind, latent, .. } = &self.spec;
        obs.check_size("observations", kind, n)?;
        if *latent > 0 {
            LearnError::check("skills", n * latent, z.len())?;
        }
        if !left.is_empty() {
            LearnError::check("remaining shares of skills", n, left.len())?;
        }
        let width = self.memory();
        if width > 0 && !memory.is_empty() {
            LearnError::check("memories", n * width, memory.len())?;
        }
        let inputs = InputBuilder { z, latent: *latent, obs, kind, stats: self.stats.as_deref() };
        let chunk = match kind {
            ObsKind::Vector(_) => VECTORS_AT_A_TIME,
            ObsKind::Image(_) => IMAGES_AT_A_TIME,
        };
        let pass = || {
            for start in (0..n).step_by(chunk) {
                let rows: Vec<usize> = (start..(start + chunk).min(n)).collect();
                let len = rows.len();
                let (first, end) = (rows[0], rows[0] + len);
                let x = self.actor.join(&inputs.input(&rows, &self.device))?;
                let before = memory.get(first * width..end * width).unwrap_or_default();
                let read_by_layers = self.actor.remember(x, before, len, &self.device);
                let mut left = left.get(first..end).map(|left| vector(left.to_vec(), &self.device));
                if len == 1 {
                    left = left.map(|left| left.repeat_dim(0, 2));
                }
                read(read_by_layers, left, len)?;
            }
            Ok(())
        };
        self.kept.during(|| guarded(&self.device, pass))
    }
}

// The outputs of a policy for a batch of observations.

/// Action distributions and values, one row per observation, in host memory.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyOutput {
    /// The action space of the rows.
    pub space: ActionSpace,
    /// True if a continuous action is the tanh of a normal number, which `head` and `log_std` then describe.
    pub squashed: bool,
    /// Normalised log-probabilities (discrete) or means (continuous), `n * dim`. In a mixed space those of each choice,
    /// and then the means.
    pub head: Vec<f32>,
    /// Logarithms of the standard deviations, `n * numbers`; empty if discrete.
    pub log_std: Vec<f32>,
    /// Estimated returns, `n`; zeros if the policy has no critic.
    pub values: Vec<f32>,
    /// What the policy remembers after these observations, `n * memory`; empty without memory.
    pub memory: Vec<f32>,
    /// True for rows whose numbers are held from an earlier tick, `n`; empty if none are. See [`Self::restrict`].
    pub held: Vec<bool>,
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
    /// Takes one draw from `rng` for each choice, and one for each dimension of a vector.
    ///
    /// # Panics
    /// If `row` is not below [`Self::len`].
    pub fn sample<R: Rng + ?Sized>(&self, row: usize, rng: &mut R) -> (ActionValue, f32) {
        let head = self.head(row);
        match self.space {
            ActionSpace::Discrete(_) => {
                let index = sample_categorical(head, rng);
                (ActionValue::Discrete(index), categorical_log_prob(head, index))
            }
            ActionSpace::Continuous(_) => {
                let action = sample_gaussian(head, self.stds(row), rng);
                if self.squashed {
                    let log_prob = squashed_log_prob(head, self.stds(row), &action);
                    return (ActionValue::Continuous(squash(&action)), log_prob);
                }
                let log_prob = self.numbers_log_prob(row, &action);
                (ActionValue::Continuous(action), log_prob)
            }
            ActionSpace::Mixed(MixedSpace { choices, .. }) => {
                let drawn: Vec<u32> = choices.ranges().map(|at| sample_categorical(&head[at], rng)).collect();
                let numbers = sample_gaussian(&head[choices.options()..], self.stds(row), rng);
                let log_prob = self.mixed_log_prob(row, choices, &drawn, &numbers);
                (ActionValue::Mixed { choices: drawn, numbers }, log_prob)
            }
        }
    }

    fn mixed_log_prob(&self, row: usize, choices: Choices, options: &[u32], numbers: &[f32]) -> f32 {
        let head = self.head(row);
        let of_choices = choices.ranges().zip(options).map(|(at, &option)| categorical_log_prob(&head[at], option));
        let sum: f32 = of_choices.sum();
        match numbers {
            [] => sum,
            numbers => sum + self.numbers_log_prob(row, numbers),
        }
    }

    /// Returns the log-density of the vector of a row; 0 if it is held.
    fn numbers_log_prob(&self, row: usize, numbers: &[f32]) -> f32 {
        match self.held.get(row) {
            Some(true) => 0.0,
            _ => gaussian_log_prob(&self.head(row)[self.space.options()..], self.stds(row), numbers),
        }
    }

    /// Returns the most likely action of `row`: the first of the most likely choices, or the mean (squashed: its
    /// tanh, the median).
    ///
    /// # Panics
    /// If `row` is not below [`Self::len`].
    pub fn greedy(&self, row: usize) -> ActionValue {
        match self.space {
            ActionSpace::Discrete(_) => ActionValue::Discrete(argmax(self.head(row))),
            ActionSpace::Continuous(_) if self.squashed => ActionValue::Continuous(squash(self.head(row))),
            ActionSpace::Continuous(_) => ActionValue::Continuous(self.head(row).to_vec()),
            ActionSpace::Mixed(MixedSpace { choices, .. }) => {
                let head = self.head(row);
                ActionValue::Mixed {
                    choices: choices.ranges().map(|at| argmax(&head[at])).collect(),
                    numbers: head[choices.options()..].to_vec(),
                }
            }
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
    pub fn log_prob(&self, row: usize, action: &ActionValue) -> Result<f32, LearnError> {
        match (self.space, action) {
            (ActionSpace::Discrete(n), ActionValue::Discrete(a)) if (*a as usize) < n => {
                Ok(categorical_log_prob(self.head(row), *a))
            }
            (ActionSpace::Continuous(n), ActionValue::Continuous(a)) if a.len() == n && self.squashed => {
                if a.iter().any(|x| x.abs() > 1.0) {
                    return Ok(f32::NEG_INFINITY);
                }
                Ok(squashed_log_prob(self.head(row), self.stds(row), &unsquash(a)))
            }
            (ActionSpace::Continuous(n), ActionValue::Continuous(a)) if a.len() == n => {
                Ok(self.numbers_log_prob(row, a))
            }
            (ActionSpace::Mixed(space), ActionValue::Mixed { choices, numbers })
                if space.misfit(choices, numbers).is_none() =>
            {
                Ok(self.mixed_log_prob(row, space.choices, choices, numbers))
            }
            (space, action) => Err(LearnError::Action(format!("{action:?} among {space}"))),
        }
    }

    /// Removes the illegal options of each row, `n * mask_width()`, true if legal: the others share their probability.
    /// Numbers that are held have the log-density 0, whichever they are: the caller replaces drawn ones by those that
    /// the game holds. Values stay unchanged. An empty mask changes nothing.
    pub fn restrict(&mut self, legal: &[bool]) {
        restrict(&mut self.head, &self.space, legal);
        self.held = held_rows(legal, &self.space);
    }

    /// Splits the outputs into these numbers of rows, in order.
    ///
    /// # Panics
    /// If there are more rows in `sizes` than [`Self::len`].
    pub fn split(mut self, sizes: &[usize]) -> Vec<Self> {
        let per_row = |numbers: &[f32]| numbers.len().checked_div(self.len()).unwrap_or_default();
        let (dim, stds, memory) = (self.space.dim(), per_row(&self.log_std), per_row(&self.memory));
        let parts = sizes.iter().map(|&rows| Self {
            space: self.space,
            squashed: self.squashed,
            head: self.head.drain(..rows * dim).collect(),
            log_std: self.log_std.drain(..rows * stds).collect(),
            values: self.values.drain(..rows).collect(),
            memory: self.memory.drain(..rows * memory).collect(),
            held: self.held.drain(..rows.min(self.held.len())).collect(),
        });
        parts.collect()
    }

    /// Returns the distributions alone.
    pub(crate) fn into_dist(self) -> HostDist {
        let log_std = (!self.log_std.is_empty()).then_some(self.log_std);
        HostDist { space: self.space, head: self.head, log_std, held: self.held }
    }

    fn head(&self, row: usize) -> &[f32] {
        let dim = self.space.dim();
        &self.head[row * dim..(row + 1) * dim]
    }

    fn stds(&self, row: usize) -> &[f32] {
        let dim = self.space.numbers();
        &self.log_std[row * dim..(row + 1) * dim]
    }
}

fn squash(numbers: &[f32]) -> Vec<f32> {
    numbers.iter().map(|&x| libm::tanhf(x)).collect()
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
            memory: Vec::new(),
            held: Vec::new(),
        }
    }

    #[test]
    fn squashed_densities_add_up_to_one() {
        let output = output(0.4, 0.7);
        let n = 20_000;
        let width = 2.0 / n as f32;
        let density = |i: usize| {
            let action = -1.0 + (i as f32 + 0.5) * width;
            f64::from(output.log_prob(0, &ActionValue::Continuous(vec![action])).expect("fits")).exp()
        };
        let total: f64 = (0..n).map(density).sum::<f64>() * f64::from(width);
        assert!((total - 1.0).abs() < 1e-3, "{total}");
        assert_eq!(output.log_prob(0, &ActionValue::Continuous(vec![1.5])).expect("fits"), f32::NEG_INFINITY);
    }

    #[test]
    fn squashed_draws_carry_their_own_density() {
        let output = output(-0.3, 0.5);
        let mut rng = Streams::new(1).stream("draw", 0);
        let mut below = 0;
        for _ in 0..4000 {
            let (action, log_prob) = output.sample(0, &mut rng);
            assert!((output.log_prob(0, &action).expect("fits") - log_prob).abs() < 1e-3);
            let ActionValue::Continuous(a) = action else { panic!("continuous") };
            assert!(a[0].abs() <= 1.0);
            below += usize::from(a[0] < (-0.3f32).tanh());
        }
        assert!((1850..2150).contains(&below), "half of the draws lie below the median: {below}");
        let ActionValue::Continuous(median) = output.greedy(0) else { panic!("continuous") };
        assert!((median[0] - (-0.3f32).tanh()).abs() < 1e-6);
    }

    #[test]
    fn gaussian_draws_carry_their_own_density_beyond_the_range_too() {
        let output = PolicyOutput { squashed: false, ..output(0.9, 0.5) };
        let mut rng = Streams::new(1).stream("draw", 0);
        let mut beyond = 0;
        for _ in 0..1000 {
            let (action, log_prob) = output.sample(0, &mut rng);
            let ActionValue::Continuous(a) = &action else { panic!("continuous") };
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
            memory: Vec::new(),
            held: Vec::new(),
        };
        let parts = discrete.split(&[1, 1]);
        assert_eq!((&parts[1].head[..], &parts[1].values[..]), (&[3.0, 4.0][..], &[6.0][..]));
    }

    #[test]
    fn the_edge_of_a_squashed_action_has_a_finite_density() {
        let output = output(9.0, 1.0);
        assert!(output.log_prob(0, &ActionValue::Continuous(vec![1.0])).expect("fits").is_finite());
    }
}

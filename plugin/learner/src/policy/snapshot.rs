//! A frozen policy for play.

use super::{Actor, Critic, InputBuilder, PolicyOutput, StateBatch};
use crate::device::{guarded, is_host};
use crate::nn::{CnnKind, ImageNet, frozen, host, vector};
use crate::norm::ObsStats;
use crate::{ActionSpace, LearnError, ObsKind, ObsSlice, PolicySpec};
use burn::tensor::{Device, Tensor};
use std::sync::Arc;

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
        Self { actor: frozen(actor), critic: critic.map(frozen), stats, spec, device }
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

    /// Returns whether it computes on the CPU.
    pub fn is_on_host(&self) -> bool {
        is_host(&self.device)
    }

    /// Returns the convolutions that read its images; `None` for vectors.
    pub fn cnn(&self) -> Option<CnnKind> {
        self.actor.cnn.as_ref().map(ImageNet::kind)
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
        let (mut head, mut log_std, mut values) = (Vec::new(), Vec::new(), Vec::new());
        let dim = self.spec.action_space.dim();
        self.for_each_chunk(StateBatch { z, left, obs: obs.into(), n }, |x, left, rows| {
            let dist = self.actor.forward(x.clone()).to_host()?;
            head.extend_from_slice(&dist.head[..rows * dim]);
            if let Some(stds) = dist.log_std {
                log_std.extend_from_slice(&stds[..rows * dim]);
            }
            self.append_values(x, left, rows, &mut values)
        })?;
        for (name, numbers) in [("actor output", &head), ("actor log_std", &log_std), ("critic output", &values)] {
            // A log-probability may be -infinity without harm.
            if numbers.iter().any(|x| x.is_nan() || *x == f32::INFINITY) {
                return Err(LearnError::NotFinite { tensor: name.to_owned(), steps: None });
            }
        }
        Ok(PolicyOutput { space: self.spec.action_space, squashed: self.actor.is_squashed(), head, log_std, values })
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
        if self.critic.is_none() {
            return Ok(vec![0.0; n]);
        }
        let mut values = Vec::with_capacity(n);
        let states = StateBatch { z, left, obs: obs.into(), n };
        self.for_each_chunk(states, |x, left, rows| self.append_values(x, left, rows, &mut values))?;
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

    /// Calls `read` with the joined inputs of some states at a time, the remaining shares of their skills, and their
    /// number, until all were read.
    ///
    /// The inputs have at least two rows. Matrix libraries sum a single row in another order than the rows of a
    /// matrix, and a lone agent must act like one of many.
    fn for_each_chunk(
        &self,
        states: StateBatch<'_>,
        mut read: impl FnMut(Tensor<2>, Option<Tensor<1>>, usize) -> Result<(), LearnError>,
    ) -> Result<(), LearnError> {
        let StateBatch { z, left, obs, n } = states;
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
        let inputs = InputBuilder { z, latent: *latent, obs, kind, stats: self.stats.as_deref() };
        let chunk = match kind {
            ObsKind::Vector(_) => VECTORS_AT_A_TIME,
            ObsKind::Image(_) => IMAGES_AT_A_TIME,
        };
        guarded(&self.device, || {
            for start in (0..n).step_by(chunk) {
                let rows: Vec<usize> = (start..(start + chunk).min(n)).collect();
                let len = rows.len();
                let x = self.actor.join(&inputs.input(&rows, &self.device))?;
                let left = left.get(rows[0]..rows[0] + len).map(|left| vector(left.to_vec(), &self.device));
                match len {
                    1 => read(x.repeat_dim(0, 2), left.map(|left| left.repeat_dim(0, 2)), len)?,
                    _ => read(x, left, len)?,
                }
            }
            Ok(())
        })
    }
}

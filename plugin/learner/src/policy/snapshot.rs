//! A frozen policy that plays.

use super::{Actor, Critic, PolicyOutput, joined_rows};
use crate::nn::{ObsRows, frozen, host, matrix};
use crate::norm::ObsStats;
use crate::{ActionSpace, LearnError, ObsKind, Observations};
use burn::tensor::{Device, Tensor};
use std::sync::Arc;

/// An inference snapshot of an actor and, if there is one, its critic.
///
/// Clones share the weights. A clone per thread needs no locks, and a row's numbers do not depend on which other rows
/// are in the batch or on the number of threads.
#[derive(Clone, Debug)]
pub struct Policy {
    pub(super) actor: Actor,
    pub(super) critic: Option<Critic>,
    pub(super) stats: Option<Arc<ObsStats>>,
    pub(super) space: ActionSpace,
    observation: ObsKind,
    pub(super) latent: usize,
    device: Device,
}

impl Policy {
    /// A snapshot of `actor` and `critic`, which must read a skill of the given width and the given observations. There
    /// are no critics of images.
    pub(crate) fn new(
        actor: &Actor,
        critic: Option<&Critic>,
        stats: Option<ObsStats>,
        space: ActionSpace,
        (observation, latent): (impl Into<ObsKind>, usize),
        device: Device,
    ) -> Self {
        Self {
            actor: frozen(actor),
            critic: critic.map(frozen),
            stats: stats.map(Arc::new),
            space,
            observation: observation.into(),
            latent,
            device,
        }
    }

    /// What it acts in.
    pub fn action_space(&self) -> ActionSpace {
        self.space
    }

    /// Width of the skill it reads; 0 if it ignores skills.
    pub fn latent(&self) -> usize {
        self.latent
    }

    /// What it observes.
    pub fn observation(&self) -> ObsKind {
        self.observation
    }

    /// Numbers in the observation it reads.
    pub fn obs_dim(&self) -> usize {
        self.observation.numbers()
    }

    /// Distributions and values for `n` vectors.
    ///
    /// `z` is `n * latent` (ignored if [`Self::latent`] is 0), `obs` is `n * obs_dim`.
    ///
    /// # Errors
    /// [`LearnError::Shape`] for inputs of the wrong length; [`LearnError::NotFinite`] if an output is NaN or infinite;
    /// [`LearnError::Config`] if it observes images.
    pub fn forward(&self, z: &[f32], obs: &[f32], n: usize) -> Result<PolicyOutput, LearnError> {
        if n == 0 {
            return Ok(self.nothing());
        }
        self.judge(self.inputs(z, obs, n)?, n)
    }

    /// [`Self::forward`] for `n` images, whose `pixels` are `n * obs_dim`, in the order channel, row, column.
    ///
    /// # Errors
    /// As [`Self::forward`]; [`LearnError::Config`] if it observes vectors.
    pub fn forward_images(&self, z: &[f32], pixels: &[u8], n: usize) -> Result<PolicyOutput, LearnError> {
        if n == 0 {
            return Ok(self.nothing());
        }
        let observations = Observations::Image(pixels.to_vec());
        observations.check("images", &self.observation, n)?;
        let images = ObsRows::new(observations, &self.observation, &self.device);
        let mut features = self.actor.observe(&images)?;
        if self.latent > 0 {
            LearnError::check("skills", n * self.latent, z.len())?;
            features = Tensor::cat(vec![matrix(z.to_vec(), n, self.latent, &self.device), features], 1);
        }
        if n == 1 {
            features = features.repeat_dim(0, 2);
        }
        self.judge(features, n)
    }

    fn nothing(&self) -> PolicyOutput {
        let (head, log_std, values) = Default::default();
        self.output(head, log_std, values)
    }

    /// The first `n` rows of what actor and critic say about joined inputs.
    fn judge(&self, x: Tensor<2>, n: usize) -> Result<PolicyOutput, LearnError> {
        let dist = self.actor.forward(x.clone()).to_host()?;
        let dim = self.space.dim();
        let mut head = dist.head;
        head.truncate(n * dim);
        let mut log_std = dist.log_std.unwrap_or_default();
        log_std.truncate(n * dim);
        let values = match &self.critic {
            Some(critic) => {
                let mut values = host(critic.forward(x))?;
                values.truncate(n);
                values
            }
            None => vec![0.0; n],
        };
        for (name, numbers) in [("actor output", &head), ("actor log_std", &log_std), ("critic output", &values)] {
            // A log-probability may be -infinity without harm.
            if numbers.iter().any(|x| x.is_nan() || *x == f32::INFINITY) {
                return Err(LearnError::NotFinite { tensor: name.to_owned(), steps: None });
            }
        }
        Ok(self.output(head, log_std, values))
    }

    fn output(&self, head: Vec<f32>, log_std: Vec<f32>, values: Vec<f32>) -> PolicyOutput {
        PolicyOutput { space: self.space, squashed: self.actor.is_squashed(), head, log_std, values }
    }

    /// Only the values of [`Self::forward`]; zeros if there is no critic.
    ///
    /// # Errors
    /// As [`Self::forward`].
    pub fn values(&self, z: &[f32], obs: &[f32], n: usize) -> Result<Vec<f32>, LearnError> {
        let Some(critic) = self.critic.as_ref().filter(|_| n > 0) else {
            return Ok(vec![0.0; n]);
        };
        let mut values = host(critic.forward(self.inputs(z, obs, n)?))?;
        values.truncate(n);
        Ok(values)
    }

    /// The joined inputs, at least two rows: matrix libraries sum a single row in another order than the rows of a
    /// matrix, and a lone agent shall act like one of many.
    fn inputs(&self, z: &[f32], obs: &[f32], n: usize) -> Result<Tensor<2>, LearnError> {
        let obs_dim = self.observation.vector("`Policy::forward`")?;
        LearnError::check("observations", n * obs_dim, obs.len())?;
        if self.latent > 0 {
            LearnError::check("skills", n * self.latent, z.len())?;
        }
        let stats = self.stats.as_deref();
        let width = self.latent + obs_dim;
        let mut rows = joined_rows(z, self.latent, obs, obs_dim, stats, 0..n);
        if n == 1 {
            rows.extend_from_within(..);
        }
        Ok(matrix(rows, n.max(2), width, &self.device))
    }
}

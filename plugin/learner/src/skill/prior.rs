//! p(z | s₀) in use.

use crate::nn::{ObsRows, frozen};
use crate::policy::Actor;
use crate::{LearnError, ObsKind, Observations};
use burn::tensor::Device;
use serde::{Deserialize, Serialize};

/// How z is taken from the prior.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum SkillDraw {
    /// A random draw (the paper's text).
    #[default]
    Sample,
    /// The mean (the paper's released code for mazes).
    Mean,
}

/// Draws skills for states. Clones share the weights.
#[derive(Clone, Debug)]
pub struct Prior {
    pub(crate) net: Option<(Actor, ObsKind, Device)>,
    latent: usize,
    pub(crate) tanh: bool,
}

impl Prior {
    /// The learned prior `net`, which reads the given observations.
    pub(crate) fn learned(
        net: &Actor,
        observation: impl Into<ObsKind>,
        latent: usize,
        tanh: bool,
        device: Device,
    ) -> Self {
        Self { net: Some((frozen(net), observation.into(), device)), latent, tanh }
    }

    /// A prior that ignores the state: standard normal, then tanh if `tanh`.
    pub fn standard_normal(latent: usize, tanh: bool) -> Self {
        Self { net: None, latent, tanh }
    }

    /// Width of z.
    pub fn latent(&self) -> usize {
        self.latent
    }

    /// Skills for `n` raw vectors (`n * obs_dim`), as the decoder and the policy take them: `n * latent`.
    ///
    /// `normal(row)` must give the next standard normal number of that row's own generator; it is called `latent`
    /// times per row, in order of rows, and not at all for [`SkillDraw::Mean`].
    ///
    /// # Errors
    /// [`LearnError::Shape`] for observations of the wrong length, [`LearnError::Config`] if the prior reads images;
    /// [`LearnError::Input`] if an observation is not finite, [`LearnError::NotFinite`] if a skill is not.
    pub fn sample(
        &self,
        obs: &[f32],
        n: usize,
        draw: SkillDraw,
        normal: &mut dyn FnMut(usize) -> f32,
    ) -> Result<Vec<f32>, LearnError> {
        self.draw(|| Observations::Vector(obs.to_vec()), n, draw, normal)
    }

    /// [`Self::sample`] for `n` images, whose `pixels` are in the order channel, row, column.
    ///
    /// # Errors
    /// As [`Self::sample`]; [`LearnError::Config`] if the prior reads vectors.
    pub fn sample_images(
        &self,
        pixels: &[u8],
        n: usize,
        draw: SkillDraw,
        normal: &mut dyn FnMut(usize) -> f32,
    ) -> Result<Vec<f32>, LearnError> {
        self.draw(|| Observations::Image(pixels.to_vec()), n, draw, normal)
    }

    fn draw(
        &self,
        observations: impl FnOnce() -> Observations,
        n: usize,
        draw: SkillDraw,
        normal: &mut dyn FnMut(usize) -> f32,
    ) -> Result<Vec<f32>, LearnError> {
        if n == 0 {
            return Ok(Vec::new());
        }
        let numbers = n * self.latent;
        let (mut z, log_std) = match &self.net {
            None => (vec![0.0; numbers], vec![0.0; numbers]),
            Some((net, kind, device)) => {
                let observations = observations();
                observations.check("observations of the prior", kind, n)?;
                let mut features = net.observe(&ObsRows::new(observations, kind, device))?;
                if n == 1 {
                    // As in `Policy`: a single row would be summed in another order.
                    features = features.repeat_dim(0, 2);
                }
                let dist = net.forward(features).to_host()?;
                (dist.head, dist.log_std.unwrap_or_default())
            }
        };
        z.truncate(numbers);
        for (i, (z, s)) in z.iter_mut().zip(&log_std).enumerate() {
            if draw == SkillDraw::Sample {
                *z += normal(i / self.latent) * s.exp();
            }
            if self.tanh {
                *z = z.tanh();
            }
        }
        if z.iter().any(|x| !x.is_finite()) {
            return Err(LearnError::NotFinite { tensor: "prior output".to_owned(), steps: None });
        }
        Ok(z)
    }
}

//! The prior p(z | s₀) in use.

use crate::{
    LearnError, ObsKind, ObsSlice,
    device::guarded,
    nn::{frozen, host},
    norm::ObsStats,
    policy::{Actor, InputBuilder, Memory},
};
use burn::tensor::Device;
use playbot_kernels::kept_memory::KeptWeights;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The choice of z from the prior.
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
    pub(crate) net: Option<PriorNet>,
    latent: usize,
    pub(crate) tanh: bool,
}

/// The network of a learned prior, and its normalisation of observations.
#[derive(Clone, Debug)]
pub(crate) struct PriorNet {
    pub(crate) actor: Actor,
    observation: ObsKind,
    pub(crate) stats: Option<Arc<ObsStats>>,
    device: Device,
    kept: KeptWeights,
}

impl Prior {
    /// Creates the learned prior `actor`, which reads the given observations, normalised by `stats` if given; its
    /// skills are squashed by tanh if `tanh`.
    pub(crate) fn learned(
        actor: &Actor,
        stats: Option<Arc<ObsStats>>,
        observation: ObsKind,
        latent: usize,
        tanh: bool,
        device: Device,
    ) -> Self {
        let kept = KeptWeights::default();
        Self { net: Some(PriorNet { actor: frozen(actor), observation, stats, device, kept }), latent, tanh }
    }

    /// Returns the standard normal of skills like these, whatever the state.
    pub fn whatever_the_state(&self) -> Self {
        Self::standard_normal(self.latent, self.tanh)
    }

    /// Creates a prior that ignores the state: standard normal, then tanh if `tanh`.
    pub fn standard_normal(latent: usize, tanh: bool) -> Self {
        Self { net: None, latent, tanh }
    }

    /// Returns the kind of its observations; `None` if it ignores the state.
    pub fn observation(&self) -> Option<ObsKind> {
        self.net.as_ref().map(|net| net.observation)
    }

    /// Returns the width of z.
    pub fn latent(&self) -> usize {
        self.latent
    }

    /// Returns how many numbers an agent remembers from one draw to the next; 0 without memory.
    pub fn memory(&self) -> usize {
        self.net.as_ref().and_then(|net| net.actor.memory.as_ref()).map_or(0, Memory::width)
    }

    /// Skills for `n` raw observations, as the decoder and the policy take them: `n * latent`.
    ///
    /// `normal(row)` must return the next standard normal number of that row's own generator. It is called `latent`
    /// times per row, in order of rows, and not at all for [`SkillDraw::Mean`].
    ///
    /// # Errors
    /// [`LearnError::Shape`] for observations of the wrong length, [`LearnError::Config`] for vectors where the prior
    /// reads images, or the other way round; [`LearnError::Input`] if an observation is not finite,
    /// [`LearnError::NotFinite`] if a skill is not.
    pub fn sample<'a>(
        &self,
        obs: impl Into<ObsSlice<'a>>,
        n: usize,
        draw: SkillDraw,
        normal: &mut dyn FnMut(usize) -> f32,
    ) -> Result<Vec<f32>, LearnError> {
        self.sample_remembering(obs, &[], n, draw, normal).map(|(skills, _)| skills)
    }

    /// Does [`Self::sample`] for agents with the memories `memory`, `n * memory()`, and returns what they remember after it
    /// beside the skills. Without any all begin anew, with zeros.
    ///
    /// # Errors
    /// As [`Self::sample`], and [`LearnError::Shape`] for memories of the wrong length.
    pub fn sample_remembering<'a>(
        &self,
        obs: impl Into<ObsSlice<'a>>,
        memory: &[f32],
        n: usize,
        draw: SkillDraw,
        normal: &mut dyn FnMut(usize) -> f32,
    ) -> Result<(Vec<f32>, Vec<f32>), LearnError> {
        if n == 0 {
            return Ok((Vec::new(), Vec::new()));
        }
        let (numbers, width) = (n * self.latent, self.memory());
        if !memory.is_empty() {
            LearnError::check("memories of the prior", n * width, memory.len())?;
        }
        let (mut z, log_std, mut after) = match &self.net {
            None => (vec![0.0; numbers], vec![0.0; numbers], Vec::new()),
            Some(PriorNet { actor, observation: kind, stats, device, kept }) => {
                let obs = obs.into();
                obs.check("observations of the prior", kind, n)?;
                let inputs = InputBuilder { z: &[], latent: 0, obs, kind, stats: stats.as_deref() };
                let pass = || {
                    let x = actor.join(&inputs.input(&(0..n).collect::<Vec<_>>(), device))?;
                    let (x, after) = actor.remember(x, memory, n, device);
                    let after = after.map_or(Ok(Vec::new()), host)?;
                    Ok((actor.forward(x).to_host()?, after))
                };
                let (dist, after) = kept.during(|| guarded(device, pass))?;
                (dist.head, dist.log_std.unwrap_or_default(), after)
            }
        };
        z.truncate(numbers);
        after.truncate(n * width);
        for (i, (z, s)) in z.iter_mut().zip(&log_std).enumerate() {
            if draw == SkillDraw::Sample {
                *z += normal(i / self.latent) * libm::expf(*s);
            }
            if self.tanh {
                *z = libm::tanhf(*z);
            }
        }
        if z.iter().any(|x| !x.is_finite()) {
            return Err(LearnError::NotFinite { tensor: "prior output".to_owned(), steps: None });
        }
        Ok((z, after))
    }
}

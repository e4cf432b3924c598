//! The three networks of the skill model together.

use super::{Encoder, SkillConfig};
use crate::nn::{ActionRows, Activation, Dist, ParamVisitor, Parameters, path};
use crate::policy::{Actor, NetShape};
use crate::rng::Streams;
use crate::{ActionSpace, Actions, LearnError};
use burn::tensor::{Device, Tensor};

/// Encoder, decoder and prior.
#[derive(Clone, Debug)]
pub struct SkillNets {
    /// q(z | τ).
    pub encoder: Encoder,
    /// π(a | s, z).
    pub decoder: Actor,
    /// p(z | s₀): an actor whose action is z, before squashing.
    pub prior: Actor,
    /// Whether the decoder sees tanh(z) and not z.
    pub tanh_latent: bool,
}

/// What the networks say about a batch of windows.
#[derive(Clone, Debug)]
pub struct SkillForward {
    /// -ln π(a | s, z) of each step, summed over action dimensions, `[steps * B]`, time-major.
    pub nll_per_step: Tensor<1>,
    /// KL(q ‖ p) of each window, before squashing, `[B]`.
    pub kl_per_sequence: Tensor<1>,
    /// z as the decoder sees it, `[B, latent]`.
    pub decoder_latent: Tensor<2>,
    /// The decoder's distributions, time-major.
    pub decoded: Dist,
}

impl SkillNets {
    /// Starting weights from the streams `skill.encoder`, `skill.decoder` and `skill.prior`.
    pub fn new(config: &SkillConfig, obs_dim: usize, space: ActionSpace, streams: &Streams, device: &Device) -> Self {
        let rng = |name| streams.stream(name, 0);
        let shape = |latent| NetShape { obs_dim, latent, hidden: config.hidden.clone(), activation: Activation::Relu };
        let latent = ActionSpace::Continuous(config.latent);
        Self {
            encoder: Encoder::new(config, obs_dim, space.dim(), &mut rng("skill.encoder"), device),
            decoder: Actor::new(&shape(config.latent), space, config.decoder_std, &mut rng("skill.decoder"), device),
            prior: Actor::new(&shape(0), latent, config.prior_std, &mut rng("skill.prior"), device),
            tanh_latent: config.tanh_latent,
        }
    }

    /// Runs a batch of B windows through all three networks.
    ///
    /// `states` `[steps * B, obs_dim]` are time-major, `first` `[B, obs_dim]` are the states of the first step,
    /// `encoded_actions` are the actions as the encoder reads them (one-hot or raw), and `noise` `[B, latent]` is standard
    /// normal: z = mean + noise · σ.
    ///
    /// # Errors
    /// [`LearnError::Action`] if `actions` do not fit the decoder.
    pub fn forward(
        &self,
        states: Tensor<2>,
        first: Tensor<2>,
        actions: &ActionRows,
        encoded_actions: Tensor<2>,
        noise: Tensor<2>,
        steps: usize,
    ) -> Result<SkillForward, LearnError> {
        let posterior = self.encoder.forward(states.clone(), encoded_actions, steps);
        let kl_per_sequence = posterior.kl(&self.prior.forward(first))?;
        let Dist::Gaussian { mean, log_std } = posterior else {
            return Err(LearnError::Action("the encoder is Gaussian".to_owned()));
        };
        let latent = mean + noise * log_std.exp();
        let decoder_latent = if self.tanh_latent { latent.tanh() } else { latent };
        let decoded = self.decoder.forward_held(decoder_latent.clone(), states, steps);
        let nll_per_step = decoded.log_prob(actions)?.neg();
        Ok(SkillForward { nll_per_step, kl_per_sequence, decoder_latent, decoded })
    }
}

/// Actions as the encoder reads them, row-major: one-hot if discrete, raw if continuous.
pub(crate) fn encoder_actions(actions: &Actions, space: ActionSpace) -> Vec<f32> {
    match actions {
        Actions::Discrete(values) => {
            let dim = space.dim();
            let mut out = vec![0.0; values.len() * dim];
            for (row, &a) in values.iter().enumerate() {
                out[row * dim + a as usize] = 1.0;
            }
            out
        }
        Actions::Continuous { values, .. } => values.clone(),
    }
}

impl Parameters for SkillNets {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.encoder.visit(&path(prefix, "encoder"), visitor);
        self.decoder.visit(&path(prefix, "decoder"), visitor);
        self.prior.visit(&path(prefix, "prior"), visitor);
    }
}

//! q(z | τ): from a window of states and actions to a latent skill.

use super::SkillConfig;
use crate::nn::{Activation, Dist, Gru, Linear, Mlp, ParamVisitor, Parameters, path};
use burn::tensor::{Device, Tensor};
use rand::Rng;

/// Three layers per step over the state (ReLU between them), joined with the action, read in both directions by
/// recurrent layers; from the two last outputs, linear heads for the mean and ln σ of z.
#[derive(Clone, Debug)]
pub struct Encoder {
    /// Per-step layers over the state.
    pub state: Mlp,
    /// The recurrent layers.
    pub gru: Gru,
    /// Head of the mean.
    pub mean: Linear,
    /// Head of ln σ, not clamped.
    pub log_std: Linear,
}

impl Encoder {
    /// Starting weights: orthogonal, recurrent layers uniform.
    pub fn new<R: Rng + ?Sized>(
        config: &SkillConfig,
        obs_dim: usize,
        action_width: usize,
        rng: &mut R,
        device: &Device,
    ) -> Self {
        let width = config.encoder_hidden;
        let state = Mlp::new(obs_dim, &[width; 2], width, Activation::Relu, 1.0, rng, device);
        let inputs = width + action_width;
        let gru = Gru::new(inputs, config.gru_hidden, config.gru_layers, true, rng, device);
        let features = 2 * config.gru_hidden;
        Self {
            state,
            gru,
            mean: Linear::new(features, config.latent, 1.0, rng, device),
            log_std: Linear::new(features, config.latent, 0.01, rng, device),
        }
    }

    /// The Gaussian over z, before any squashing, for each of B windows of `steps` steps.
    ///
    /// `states` `[steps * B, obs_dim]` and `actions` `[steps * B, action_width]` (one-hot or raw) are time-major:
    /// row `t * B + b`.
    pub fn forward(&self, states: Tensor<2>, actions: Tensor<2>, steps: usize) -> Dist {
        let features = self.state.forward(states);
        let joined = Tensor::cat(vec![features, actions], 1);
        let summary = self.gru.summary(joined, steps);
        Dist::Gaussian { mean: self.mean.forward(summary.clone()), log_std: self.log_std.forward(summary) }
    }
}

impl Parameters for Encoder {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.state.visit(&path(prefix, "state"), visitor);
        self.gru.visit(&path(prefix, "gru"), visitor);
        self.mean.visit(&path(prefix, "mean"), visitor);
        self.log_std.visit(&path(prefix, "log_std"), visitor);
    }
}

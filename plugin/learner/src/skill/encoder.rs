//! The encoder q(z | τ): from a window of states and actions to a latent skill.

use super::SkillConfig;
use crate::nn::{
    Activation, Dist, Gru, ImageNet, Linear, Mlp, ObsBatch, ParamSource, ParamVisitor, Parameters, RandomInit, path,
};
use crate::{LearnError, ObsKind};
use burn::tensor::{Device, Tensor};
use rand::Rng;

/// The network over each step's observation.
#[derive(Clone, Debug)]
pub enum StateNet {
    /// Three layers over a vector, ReLU between them; `state` in names.
    Vector(Mlp),
    /// Convolutions over an image; `cnn` in names.
    Image(ImageNet),
}

/// The features of each step's observation, joined with the action, read in both directions by recurrent layers; from
/// the two last outputs, linear heads for the mean and ln σ of z.
#[derive(Clone, Debug)]
pub struct Encoder {
    /// Per-step layers over the observation.
    pub state: StateNet,
    /// The recurrent layers.
    pub gru: Gru,
    /// Head of the mean.
    pub mean: Linear,
    /// Head of ln σ, not clamped.
    pub log_std: Linear,
}

impl Encoder {
    /// Creates starting weights: orthogonal, recurrent layers uniform. `action_width` is that of an action as the
    /// encoder reads it.
    ///
    /// # Errors
    /// [`LearnError::Config`] if images are too small for the convolutions.
    pub fn new<R: Rng + ?Sized>(
        config: &SkillConfig,
        observation: ObsKind,
        action_width: usize,
        rng: &mut R,
        device: &Device,
    ) -> Result<Self, LearnError> {
        if let ObsKind::Image(image) = observation {
            config.cnn.check_image(image)?;
        }
        let Ok(encoder) = Self::build(&mut RandomInit { rng, device }, "", config, observation, action_width);
        Ok(encoder)
    }

    /// Creates an encoder as [`Self::new`], with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        config: &SkillConfig,
        observation: ObsKind,
        action_width: usize,
    ) -> Result<Self, S::Error> {
        let (state, features) = match observation {
            ObsKind::Vector(obs_dim) => {
                let (name, width) = (path(prefix, "state"), config.encoder_hidden);
                let net = Mlp::build(source, &name, obs_dim, &[width; 2], width, Activation::Relu, 1.0)?;
                (StateNet::Vector(net), width)
            }
            ObsKind::Image(image) => {
                let net = ImageNet::build(source, &path(prefix, "cnn"), &config.cnn, image)?;
                (StateNet::Image(net), config.cnn.features())
            }
        };
        let inputs = features.saturating_add(action_width);
        let gru = Gru::build(source, &path(prefix, "gru"), inputs, config.gru_hidden, config.gru_layers, true)?;
        let summary = config.gru_hidden.saturating_mul(2);
        Ok(Self {
            state,
            gru,
            mean: Linear::build(source, &path(prefix, "mean"), summary, config.latent, 1.0)?,
            log_std: Linear::build(source, &path(prefix, "log_std"), summary, config.latent, 0.01)?,
        })
    }

    /// Returns the Gaussian over z, before any squashing, for each of B windows of `steps` steps.
    ///
    /// `states`, `steps * B` rows, and `actions` `[steps * B, action_width]`
    /// ([`ActionInput`](super::ActionInput)) are time-major: row `t * B + b`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the observations are of the other kind than the network.
    pub fn forward(&self, states: &ObsBatch, actions: Tensor<2>, steps: usize) -> Result<Dist, LearnError> {
        let summary = self.summary(states, actions, steps)?;
        Ok(Dist::Gaussian { mean: self.mean.forward(summary.clone()), log_std: self.log_std.forward(summary) })
    }

    /// Returns the recurrent layers' summary of each window, `[B, 2 * gru_hidden]`; inputs and errors as
    /// [`Self::forward`].
    pub fn summary(&self, states: &ObsBatch, actions: Tensor<2>, steps: usize) -> Result<Tensor<2>, LearnError> {
        let joined = Tensor::cat(vec![self.state.forward(states)?, actions], 1);
        Ok(self.gru.summary(joined, steps))
    }
}

impl StateNet {
    /// Returns the features of each observation, `[n, features]`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the observations are of the other kind than the network.
    pub fn forward(&self, states: &ObsBatch) -> Result<Tensor<2>, LearnError> {
        match (self, states) {
            (Self::Vector(net), ObsBatch::Vector(x)) => Ok(net.forward(x.clone())),
            (Self::Image(net), ObsBatch::Image(x)) => Ok(net.forward(x.clone())),
            _ => Err(LearnError::Config("the encoder got observations of the other kind".to_owned())),
        }
    }
}

impl Parameters for Encoder {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        match &mut self.state {
            StateNet::Vector(net) => net.visit(&path(prefix, "state"), visitor),
            StateNet::Image(net) => net.visit(&path(prefix, "cnn"), visitor),
        }
        self.gru.visit(&path(prefix, "gru"), visitor);
        self.mean.visit(&path(prefix, "mean"), visitor);
        self.log_std.visit(&path(prefix, "log_std"), visitor);
    }
}

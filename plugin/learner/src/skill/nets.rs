//! The three networks of the skill model together.

use super::{Encoder, SkillConfig};
use crate::nn::{ActionRows, Activation, Dist, ImageNet, ObsRows, ParamVisitor, Parameters, path};
use crate::policy::{Actor, NetShape};
use crate::rng::Streams;
use crate::{ActionSpace, LearnError, ObsKind};
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
    /// Starting weights from the streams `skill.encoder`, `skill.decoder` and `skill.prior`, and `skill.decoder.cnn` and
    /// `skill.prior.cnn` for images, of which each of the three networks has a trunk of its own.
    ///
    /// # Errors
    /// [`LearnError::Config`] if images are too small for the convolutions.
    pub fn new(
        config: &SkillConfig,
        observation: ObsKind,
        space: ActionSpace,
        streams: &Streams,
        device: &Device,
    ) -> Result<Self, LearnError> {
        let action_width = config.action_input.width(space);
        let (decoder, prior) = Self::actors(config, observation, space, streams, device)?;
        let mut rng = streams.stream("skill.encoder", 0);
        Ok(Self {
            encoder: Encoder::new(config, observation, action_width, &mut rng, device)?,
            decoder,
            prior,
            tanh_latent: config.tanh_latent,
        })
    }

    /// Decoder and prior alone, as in [`Self::new`].
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(crate) fn actors(
        config: &SkillConfig,
        observation: ObsKind,
        space: ActionSpace,
        streams: &Streams,
        device: &Device,
    ) -> Result<(Actor, Actor), LearnError> {
        let rng = |name: &str| streams.stream(name, 0);
        let actor = |name: &str, latent, space, std| -> Result<Actor, LearnError> {
            let obs_dim = match observation {
                ObsKind::Vector(width) => width,
                ObsKind::Image(_) => config.cnn.features(),
            };
            let hidden = config.hidden.clone();
            let shape = NetShape { obs_dim, latent, hidden, activation: Activation::Relu };
            let actor = Actor::new(&shape, space, std, &mut rng(name), device);
            let ObsKind::Image(shape) = observation else { return Ok(actor) };
            Ok(actor.with_cnn(ImageNet::new(&config.cnn, shape, &mut rng(&format!("{name}.cnn")), device)?))
        };
        let decoder = actor("skill.decoder", config.latent, space, config.decoder_std)?;
        let prior = actor("skill.prior", 0, ActionSpace::Continuous(config.latent), config.prior_std)?;
        Ok((decoder, prior))
    }

    /// Runs a batch of B windows through all three networks.
    ///
    /// `states`, `steps * B` rows, are time-major, so that the first B rows are those of the first step;
    /// `encoded_actions` are the actions as the encoder reads them ([`ActionInput`](super::ActionInput)), and `noise`
    /// `[B, latent]` is standard normal: z = mean + noise · σ.
    ///
    /// # Errors
    /// [`LearnError::Action`] if `actions` do not fit the decoder; [`LearnError::Config`] if the observations are of the
    /// other kind than the networks.
    pub fn forward(
        &self,
        states: &ObsRows,
        actions: &ActionRows,
        encoded_actions: Tensor<2>,
        noise: Tensor<2>,
        steps: usize,
    ) -> Result<SkillForward, LearnError> {
        let posterior = self.encoder.forward(states, encoded_actions, steps)?;
        let first = self.prior.observe(&states.first(states.rows() / steps.max(1)))?;
        let kl_per_sequence = posterior.kl(&self.prior.forward(first))?;
        let Dist::Gaussian { mean, log_std } = posterior else {
            return Err(LearnError::Action("the encoder is Gaussian".to_owned()));
        };
        let latent = mean + noise * log_std.exp();
        let decoder_latent = if self.tanh_latent { latent.tanh() } else { latent };
        let decoded = self.decoder.forward_held(decoder_latent.clone(), self.decoder.observe(states)?, steps);
        let nll_per_step = decoded.log_prob(actions)?.neg();
        Ok(SkillForward { nll_per_step, kl_per_sequence, decoder_latent, decoded })
    }
}

impl Parameters for SkillNets {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.encoder.visit(&path(prefix, "encoder"), visitor);
        self.decoder.visit(&path(prefix, "decoder"), visitor);
        self.prior.visit(&path(prefix, "prior"), visitor);
    }
}

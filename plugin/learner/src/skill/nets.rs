//! The three networks of the skill model together.

use super::{Encoder, SkillConfig, SkillDescription, StateHeads};
use crate::file::TensorFile;
use crate::nn::{ActionBatch, Dist, ObsBatch, ParamVisitor, Parameters, path};
use crate::policy::Actor;
use crate::rng::Streams;
use crate::{ActionSpace, FileError, LearnError, ObsKind};
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
    /// True if the decoder sees tanh(z) and not z.
    pub tanh_latent: bool,
    /// Heads that predict the state, while a model is trained with [`SkillConfig::state_weight`]; never in a finished
    /// model.
    pub state_heads: Option<StateHeads>,
}

/// The networks' outputs for a batch of windows.
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
    /// Features of the decoder's trunk for each step, `[steps * B, features]`, time-major; vectors unchanged.
    pub decoder_features: Tensor<2>,
    /// Features of the prior's trunk for each window's first step, `[B, features]`.
    pub prior_features: Tensor<2>,
}

impl SkillNets {
    /// Creates starting weights from the streams `skill.encoder`, `skill.decoder` and `skill.prior`, and
    /// `skill.decoder.cnn` and `skill.prior.cnn` for images: each of the three networks has its own trunk.
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
        let description = SkillDescription { config: config.clone(), observation, action_space: space };
        let Actors { decoder, prior } = Actors::fresh(&description, streams, device)?;
        let mut rng = streams.stream("skill.encoder", 0);
        let encoder = Encoder::new(config, observation, config.action_input.width(space), &mut rng, device)?;
        Ok(Self { encoder, decoder, prior, tanh_latent: config.tanh_latent, state_heads: None })
    }

    /// Reads the networks of a skill model out of a file.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen.
    pub(crate) fn stored(
        description: &SkillDescription,
        file: &mut TensorFile,
        prefix: &str,
        device: &Device,
    ) -> Result<Self, FileError> {
        let Actors { decoder, prior } = Actors::stored(description, file, prefix, device)?;
        let (config, observation) = (&description.config, description.observation);
        let action_width = config.action_input.width(description.action_space);
        let encoder =
            Encoder::build(&mut file.params(device), &path(prefix, "encoder"), config, observation, action_width)?;
        Ok(Self { encoder, decoder, prior, tanh_latent: config.tanh_latent, state_heads: None })
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
        states: &ObsBatch,
        actions: &ActionBatch,
        encoded_actions: Tensor<2>,
        noise: Tensor<2>,
        steps: usize,
    ) -> Result<SkillForward, LearnError> {
        let posterior = self.encoder.forward(states, encoded_actions, steps)?;
        let prior_features = self.prior.observe(&states.first(states.rows() / steps.max(1)))?;
        let kl_per_sequence = posterior.kl(&self.prior.forward(prior_features.clone()))?;
        let Dist::Gaussian { mean, log_std } = posterior else {
            return Err(LearnError::Action("the encoder is Gaussian".to_owned()));
        };
        let latent = mean + noise * log_std.exp();
        let decoder_latent = if self.tanh_latent { latent.tanh() } else { latent };
        let decoder_features = self.decoder.observe(states)?;
        let decoded = self.decoder.forward_held(decoder_latent.clone(), decoder_features.clone(), steps);
        let nll_per_step = decoded.log_prob(actions)?.neg();
        Ok(SkillForward { nll_per_step, kl_per_sequence, decoder_latent, decoded, decoder_features, prior_features })
    }
}

/// Decoder and prior alone, which suffice to use a skill model.
#[derive(Clone, Debug)]
pub(crate) struct Actors {
    pub(crate) decoder: Actor,
    pub(crate) prior: Actor,
}

impl Actors {
    /// Creates starting weights, from the streams that [`SkillNets::new`] names.
    fn fresh(description: &SkillDescription, streams: &Streams, device: &Device) -> Result<Self, LearnError> {
        let (decoder, prior) = (description.decoder_spec(), description.prior_spec());
        Ok(Self {
            decoder: description.decoder_shape().fresh(&decoder, streams, "skill.decoder", device)?,
            prior: description.prior_shape().fresh(&prior, streams, "skill.prior", device)?,
        })
    }

    /// Reads the weights of a file.
    ///
    /// # Errors
    /// [`FileError::Learner`] for impossible settings; else as [`SkillNets::stored`].
    pub(crate) fn stored(
        description: &SkillDescription,
        file: &mut TensorFile,
        prefix: &str,
        device: &Device,
    ) -> Result<Self, FileError> {
        let config = &description.config;
        config.validate().map_err(|e| file.learner(e))?;
        config.check_observation(description.observation).map_err(|e| file.learner(e))?;
        let (decoder, prior) = (description.decoder_spec(), description.prior_spec());
        Ok(Self {
            decoder: description.decoder_shape().stored(&decoder, file, &path(prefix, "decoder"), device)?,
            prior: description.prior_shape().stored(&prior, file, &path(prefix, "prior"), device)?,
        })
    }
}

impl Parameters for SkillNets {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.encoder.visit(&path(prefix, "encoder"), visitor);
        self.decoder.visit(&path(prefix, "decoder"), visitor);
        self.prior.visit(&path(prefix, "prior"), visitor);
        if let Some(heads) = &mut self.state_heads {
            heads.visit(&path(prefix, "state_heads"), visitor);
        }
    }
}

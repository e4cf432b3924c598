//! The three networks of the skill model together.

use crate::{
    ActionSpace, FileError, LearnError, ObsKind,
    file::TensorFile,
    legal::{free_rows, logit_offsets},
    nn::{
        ActionBatch, Dist, Gru, ImageNet, Linear, Mlp, ObsBatch, ParamSource, ParamVisitor, Parameters, RandomInit,
        path, vector,
    },
    policy::{Actor, ENTITIES, EntityEncoder, EntityShape},
    rng::Streams,
    skill::{Dataset, SkillConfig, SkillDescription},
};
use burn::tensor::{Device, Tensor};
use playbot_kernels::{
    elementwise::Activation,
    host_ops::{exp, tanh},
};
use rand::Rng;
use std::sync::Arc;

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
    /// The number of legal actions of each step, `[steps * B]`, if some are illegal.
    pub legal_count: Option<Tensor<1>>,
}

impl SkillForward {
    /// Gives illegal actions of `space` probability 0, and leaves out numbers that are held. `legal` is the mask of each
    /// step, time-major, or is empty without masks. `actions` are those that were taken.
    ///
    /// # Errors
    /// [`LearnError::Action`] if `actions` do not fit the decoder.
    pub(super) fn restricted(
        self,
        legal: &[bool],
        space: ActionSpace,
        actions: &ActionBatch,
        device: &Device,
    ) -> Result<Self, LearnError> {
        let (width, choices) = (space.mask_width(), space.choices());
        if legal.is_empty() {
            return Ok(self);
        }
        let rows: Vec<usize> = (0..legal.len() / width).collect();
        let mut decoded = self.decoded.clone().with_free(free_rows(legal, &rows, &space, device).as_ref());
        if let Some(offsets) = logit_offsets(legal, &rows, &space, device) {
            decoded = decoded.with_offsets(&offsets);
        }
        let count = |mask: &[bool]| match mask.iter().filter(|&&is_legal| is_legal).count() {
            0 => mask.len() as f32,
            count => count as f32,
        };
        // Of several choices, the number of legal actions is the product.
        let actions_of = |mask: &[bool]| choices.ranges().map(|at| count(&mask[at])).product();
        let counts = legal.chunks_exact(width).map(actions_of).collect();
        let nll_per_step = decoded.log_prob(actions)?.neg();
        Ok(Self { nll_per_step, decoded, legal_count: Some(vector(counts, device)), ..self })
    }
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
    /// `states`, `steps * B` rows, are time-major, so that the first B rows are those of the first step.
    /// `encoded_actions` are the actions as the encoder reads them ([`ActionInput`](crate::skill::ActionInput)), and
    /// `noise` `[B, latent]` is standard normal: z = mean + noise · σ.
    ///
    /// # Errors
    /// [`LearnError::Action`] if `actions` do not fit the decoder; [`LearnError::Config`] if the observations are of
    /// the other kind than the networks.
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
        let Dist::Gaussian { mean, log_std, .. } = posterior else {
            return Err(LearnError::Action("the encoder is Gaussian".to_owned()));
        };
        let latent = mean + noise * exp(log_std);
        let decoder_latent = if self.tanh_latent { tanh(latent) } else { latent };
        let decoder_features = self.decoder.observe(states)?;
        let decoded = self.decoder.forward_held(decoder_latent.clone(), decoder_features.clone(), steps);
        let nll_per_step = decoded.log_prob(actions)?.neg();
        Ok(SkillForward {
            nll_per_step,
            kl_per_sequence,
            decoder_latent,
            decoded,
            decoder_features,
            prior_features,
            legal_count: None,
        })
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

// The encoder q(z | τ): from a window of states and actions to a latent skill.

/// The network over each step's observation.
#[derive(Clone, Debug)]
pub enum StateNet {
    /// Three layers over a vector, ReLU between them; `state` in names.
    Vector(Mlp),
    /// The same behind the encoder of a vector's sets; `state.entities` in names.
    Entities(EntityEncoder, Mlp),
    /// Convolutions over an image; `cnn` in names.
    Image(ImageNet),
}

/// The features of each step's observation, joined with the action, read in both directions by recurrent layers. From
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
                let entities = config.entities.shape(obs_dim);
                let inputs = entities.as_ref().map_or(obs_dim, EntityShape::features);
                let net = Mlp::build(source, &name, inputs, &[width; 2], width, Activation::Relu, 1.0)?;
                let state = match entities {
                    None => StateNet::Vector(net),
                    Some(shape) => {
                        StateNet::Entities(EntityEncoder::build(source, &path(&name, ENTITIES), &shape)?, net)
                    }
                };
                (state, width)
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
    /// ([`ActionInput`](crate::skill::ActionInput)) are time-major: row `t * B + b`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the observations are of the other kind than the network.
    pub fn forward(&self, states: &ObsBatch, actions: Tensor<2>, steps: usize) -> Result<Dist, LearnError> {
        let summary = self.summary(states, actions, steps)?;
        Ok(Dist::Gaussian {
            mean: self.mean.forward(summary.clone()),
            log_std: self.log_std.forward(summary),
            free: None,
        })
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
            (Self::Entities(entities, net), ObsBatch::Vector(x)) => Ok(net.forward(entities.forward(x.clone())?)),
            (Self::Image(net), ObsBatch::Image(x)) => Ok(net.forward(x.clone())),
            _ => Err(LearnError::Config("the encoder got observations of the other kind".to_owned())),
        }
    }
}

impl Parameters for Encoder {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        match &mut self.state {
            StateNet::Vector(net) => net.visit(&path(prefix, "state"), visitor),
            StateNet::Entities(entities, net) => {
                let name = path(prefix, "state");
                entities.visit(&path(&name, ENTITIES), visitor);
                net.visit(&name, visitor);
            }
            StateNet::Image(net) => net.visit(&path(prefix, "cnn"), visitor),
        }
        self.gru.visit(&path(prefix, "gru"), visitor);
        self.mean.visit(&path(prefix, "mean"), visitor);
        self.log_std.visit(&path(prefix, "log_std"), visitor);
    }
}

// An auxiliary task for learning from pictures: the trunks of decoder and prior predict the game's state.
//
// A recorded action carries little information about a picture. The vector that the game fills for its vector sensor
// carries much: the positions of walls and of the coin. Recordings are replayed through both sensors, and a linear
// layer over a trunk's features learns the vector, with its gradient reaching the trunk. The layers are dropped
// after training: the model reads pictures alone. (An auxiliary task as in Jaderberg et al. 2017, "Reinforcement
// learning with unsupervised auxiliary tasks", with data that only the simulator knows as its target.)

/// One linear layer for each of the two trunks.
#[derive(Clone, Debug)]
pub struct StateHeads {
    /// From the decoder's features.
    pub decoder: Linear,
    /// From the prior's.
    pub prior: Linear,
}

impl StateHeads {
    /// Creates starting weights from the stream `skill.state_heads`, for trunks of `features` and states of
    /// `numbers`.
    pub(super) fn new(features: usize, numbers: usize, streams: &Streams, device: &Device) -> Self {
        let mut rng = streams.stream("skill.state_heads", 0);
        let Ok(heads) = Self::build(&mut RandomInit { rng: &mut rng, device }, "", features, numbers);
        heads
    }

    pub(super) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        features: usize,
        numbers: usize,
    ) -> Result<Self, S::Error> {
        let mut layer = |name| Linear::build(source, &path(prefix, name), features, numbers, 1.0);
        Ok(Self { decoder: layer("decoder")?, prior: layer("prior")? })
    }

    /// Returns the mean squared error, over the state's numbers, with which features predict `states` `[steps * B,
    /// numbers]`, time-major: summed over a window's steps, and for the prior its first, and the mean over B windows,
    /// `[1]`. Predicting the mean of normalised states costs steps + 1.
    pub(super) fn error(&self, forward: &SkillForward, states: &Tensor<2>) -> Tensor<1> {
        let [windows, _] = forward.decoder_latent.dims();
        let error = |head: &Linear, features: &Tensor<2>, states: Tensor<2>| {
            let [_, numbers] = states.dims();
            (head.forward(features.clone()) - states).square().sum() / (numbers * windows) as f32
        };
        let first = states.clone().narrow(0, 0, windows);
        error(&self.decoder, &forward.decoder_features, states.clone())
            + error(&self.prior, &forward.prior_features, first)
    }
}

/// Returns the number of values predicted from each picture, if any.
pub(super) fn predicted_numbers(config: &SkillConfig, dataset: &Dataset) -> Option<usize> {
    let states = dataset.states.as_ref().filter(|_| config.tells_states())?;
    Some(states.obs_dim())
}

impl Parameters for StateHeads {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.decoder.visit(&path(prefix, "decoder"), visitor);
        self.prior.visit(&path(prefix, "prior"), visitor);
    }
}

impl Dataset {
    /// Adds the vectors of the game's vector sensor for the same steps, for [`SkillConfig::state_weight`].
    ///
    /// # Errors
    /// [`LearnError::Config`] if `states` holds no vectors, [`LearnError::Shape`] if it holds other episodes.
    pub fn with_states(self, states: Self) -> Result<Self, LearnError> {
        if !matches!(states.observation(), ObsKind::Vector(_)) {
            return Err(LearnError::Config("states are vectors".to_owned()));
        }
        LearnError::check("episodes of states", self.episodes(), states.episodes())?;
        for (seen, state) in self.episodes.iter().zip(states.episodes.iter()) {
            LearnError::check("states of an episode", seen.actions.len(), state.actions.len())?;
        }
        Ok(Self { states: Some(Arc::new(states)), ..self })
    }
}

//! An auxiliary task for learning from pictures: the trunks of decoder and prior predict the game's state.
//!
//! A recorded action carries little information about a picture. The vector that the game fills for its vector sensor
//! carries much: the positions of walls and of the coin. Recordings are replayed through both sensors, and a linear
//! layer over a trunk's features learns the vector, with its gradient reaching the trunk. The layers are dropped
//! after training: the model reads pictures alone. (An auxiliary task as in Jaderberg et al. 2017, "Reinforcement
//! learning with unsupervised auxiliary tasks", with data that only the simulator knows as its target.)

use super::{Dataset, SkillConfig, SkillForward};
use crate::nn::{Linear, ParamSource, ParamVisitor, Parameters, RandomInit, path};
use crate::rng::Streams;
use crate::{LearnError, ObsKind};
use burn::tensor::{Device, Tensor};
use std::sync::Arc;

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
pub(super) fn told_numbers(config: &SkillConfig, dataset: &Dataset) -> Option<usize> {
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

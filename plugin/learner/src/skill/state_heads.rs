//! An aid to learning from pictures: what the trunks of decoder and prior make of one must tell the game's state.
//!
//! A recorded action says little of a picture. The vector that the game fills for its vector sensor says much: where
//! walls are, and where the coin is. Recordings are replayed through both sensors, and a linear layer over a trunk's
//! features learns the vector, with its gradient reaching the trunk. The layers are of use while the skill model is
//! learned and no longer: the model reads pictures alone. (An auxiliary task as in Jaderberg et al. 2017, "Reinforcement
//! learning with unsupervised auxiliary tasks", with what only the simulator knows as its target.)

use super::{Dataset, SkillConfig, SkillForward, SkillTrainer, Window};
use crate::nn::{Linear, ParamSource, ParamVisitor, Parameters, RandomInit, matrix, path};
use crate::rng::Streams;
use crate::{LearnError, ObsKind, Observations};
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
    /// Starting weights from the stream `skill.state_heads`, for trunks of `features` and states of `numbers`.
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

    /// The mean over numbers of the squared error with which features tell `states` `[steps * B, numbers]`, time-major:
    /// summed over a window's steps, and for the prior its first, and the mean over B windows, `[1]`. Always telling the
    /// mean of normalised states costs steps + 1.
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

impl SkillTrainer {
    /// The squared error with which the state of `windows` of `dataset` is told, `[1]`, where it is to be.
    pub(super) fn state_error(
        &self,
        dataset: &Dataset,
        windows: &[Window],
        forward: &SkillForward,
    ) -> Result<Option<Tensor<1>>, LearnError> {
        let (Some(heads), Some(states), Some(stats)) = (&self.nets.state_heads, &dataset.states, &self.state_stats)
        else {
            return Ok(None);
        };
        let steps = self.config.window;
        let (Observations::Vector(values), _) = states.gather(windows, steps)? else {
            return Err(LearnError::Config("states are vectors".to_owned()));
        };
        let rows = steps * windows.len();
        let states = matrix(stats.normalize(&values), rows, states.obs_dim(), &self.device.plain());
        Ok(Some(heads.error(forward, &states)))
    }
}

/// Numbers of the state that is told of each picture, if it is to be.
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
    /// Adds what the game's vector sensor saw of the same steps, for
    /// [`SkillConfig::state_weight`].
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

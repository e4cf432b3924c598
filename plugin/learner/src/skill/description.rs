//! The description of a skill model's weights, and the architecture that follows from it.

use super::SkillConfig;
use crate::file::TensorFile;
use crate::nn::Activation;
use crate::norm::{ObsStats, take_obs_stats};
use crate::policy::{ActorShape, StdKind};
use crate::{ActionSpace, FileError, ObsKind, PolicySpec};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The settings of a skill model, and its observation and action space.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields)]
pub(crate) struct SkillDescription {
    pub(crate) config: SkillConfig,
    // Files of vectors were written before there were images.
    #[serde(alias = "obs_dim")]
    pub(crate) observation: ObsKind,
    pub(crate) action_space: ActionSpace,
}

impl SkillDescription {
    /// Returns the inputs and outputs of the decoder.
    pub(crate) fn decoder_spec(&self) -> PolicySpec {
        PolicySpec { obs: self.observation, latent: self.config.latent, action_space: self.action_space }
    }

    /// Returns the inputs and outputs of the prior: its action is the skill.
    pub(crate) fn prior_spec(&self) -> PolicySpec {
        PolicySpec { obs: self.observation, latent: 0, action_space: ActionSpace::Continuous(self.config.latent) }
    }

    /// Returns the decoder's layers.
    pub(crate) fn decoder_shape(&self) -> ActorShape {
        self.actor(&self.decoder_spec(), self.config.decoder_std)
    }

    /// Returns the prior's layers.
    pub(crate) fn prior_shape(&self) -> ActorShape {
        self.actor(&self.prior_spec(), self.config.prior_std)
    }

    fn actor(&self, spec: &PolicySpec, std: StdKind) -> ActorShape {
        ActorShape::new(spec, &self.config.cnn, &self.config.hidden, Activation::Relu, std.into())
    }

    /// Takes the frozen normaliser called `name` out of a file, if the networks use one.
    pub(crate) fn take_stats(&self, file: &mut TensorFile, name: &str) -> Result<Option<Arc<ObsStats>>, FileError> {
        if !self.config.norm_obs {
            return Ok(None);
        }
        Ok(Some(Arc::new(take_obs_stats(file, name, self.observation.numbers())?)))
    }
}

//! A frozen skill model in the form that a tied learner needs.

use crate::nn::moved;
use crate::norm::ObsStats;
use crate::policy::{Actor, ActorShape, Policy};
use crate::score::{PriorKind, ScoreConfig};
use crate::skill::{Actors, Prior, SkillDescription, SkillModel, SkillSource};
use crate::{DeviceKind, LearnError, PolicySpec};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The network of a skill model that a policy starts as and stays close to.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) enum TiedTo {
    /// The decoder π(a | s, z), for a policy that acts.
    #[default]
    Decoder,
    /// The prior p(z | s), for a policy whose actions are skills.
    Prior,
}

impl TiedTo {
    pub(crate) fn is_decoder(&self) -> bool {
        *self == Self::Decoder
    }
}

/// The decoder and the prior of a skill model, and the settings for their use.
#[derive(Clone, Debug)]
pub(crate) struct Teacher {
    pub(crate) config: ScoreConfig,
    pub(crate) tied_to: TiedTo,
    pub(crate) description: SkillDescription,
    pub(super) actors: Actors,
    /// Frozen normalisation of observations for decoder, prior and the policy that is tied to them.
    pub(crate) stats: Option<Arc<ObsStats>>,
}

impl Teacher {
    /// Creates a teacher of `model`, used by the settings of `config`.
    pub(crate) fn new(
        config: ScoreConfig,
        tied_to: TiedTo,
        model: &SkillModel,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        let mut actors = Actors { decoder: model.nets.decoder.clone(), prior: model.nets.prior.clone() };
        if model.device != device {
            device.check()?;
            let to = device.plain();
            actors = Actors { decoder: moved(&actors.decoder, &to)?, prior: moved(&actors.prior, &to)? };
        }
        let (description, stats) = (model.description.clone(), model.stats.clone());
        Ok(Self { config, tied_to, description, actors, stats })
    }

    /// Returns the inputs and outputs of a policy that is tied to this skill model.
    pub(crate) fn policy_spec(&self) -> PolicySpec {
        let latent = if self.config.condition { self.latent() } else { 0 };
        match self.tied_to {
            TiedTo::Decoder => PolicySpec { latent, ..self.description.decoder_spec() },
            TiedTo::Prior => self.description.prior_spec(),
        }
    }

    /// Returns the layers of a policy that is a copy.
    pub(crate) fn shape(&self) -> ActorShape {
        match self.tied_to {
            TiedTo::Decoder => self.description.decoder_shape(),
            TiedTo::Prior => self.description.prior_shape(),
        }
    }

    /// Returns the width of the skills that a rollout of the policy must hold.
    pub(crate) fn rollout_latent(&self) -> usize {
        match self.tied_to {
            TiedTo::Decoder => self.latent(),
            TiedTo::Prior => 0,
        }
    }

    /// Returns the width of a skill.
    pub(crate) fn latent(&self) -> usize {
        self.description.config.latent
    }

    /// Returns whether the policy's layers are those of the network that it is tied to, and not those of the
    /// learner's settings.
    pub(crate) fn is_copied(&self) -> bool {
        self.config.init_from_decoder
    }

    /// Returns the network that a copying policy starts as.
    pub(crate) fn origin(&self) -> &Actor {
        match self.tied_to {
            TiedTo::Decoder => &self.actors.decoder,
            TiedTo::Prior => &self.actors.prior,
        }
    }

    /// Checks that these settings are possible. `norm_obs`: the learner would normalise observations itself.
    ///
    /// # Errors
    /// [`LearnError::Config`] if they are not.
    pub(crate) fn check(&self, norm_obs: bool) -> Result<(), LearnError> {
        self.config.validate()?;
        self.config.check_space(self.policy_spec().action_space)?;
        let bad = |text: &str| Err(LearnError::Config(text.to_owned()));
        if norm_obs && self.description.config.norm_obs {
            return bad(
                "norm_obs cannot be combined with a skill model that normalises observations: the policy uses the same \
                 frozen normaliser",
            );
        }
        if norm_obs && self.is_copied() {
            return bad(
                "norm_obs cannot be combined with score init_from_decoder: the decoder reads raw observations; set \
                 norm_obs of the skill model, which then normalises for both",
            );
        }
        Ok(())
    }

    /// Returns the source of skills, by [`ScoreConfig::prior`].
    pub(crate) fn prior(&self, device: DeviceKind) -> Prior {
        match self.config.prior {
            PriorKind::StandardNormal => Prior::standard_normal(self.latent(), self.description.config.tanh_latent),
            PriorKind::Learned => self.prior_of(&self.actors.prior, device),
        }
    }

    /// Returns skills from `actor`, which has the prior's layers.
    pub(crate) fn prior_of(&self, actor: &Actor, device: DeviceKind) -> Prior {
        let (latent, tanh) = (self.latent(), self.description.config.tanh_latent);
        Prior::learned(actor, self.stats.clone(), self.description.observation, latent, tanh, device.plain())
    }

    /// Returns prior and decoder with the skill interval and the draw, as a policy needs them in play.
    pub(crate) fn source(&self, device: DeviceKind) -> SkillSource {
        self.source_of(self.prior(device), device)
    }

    /// Does [`Self::source`] with skills from `prior`.
    pub(crate) fn source_of(&self, prior: Prior, device: DeviceKind) -> SkillSource {
        let (horizon, draw) = (self.config.horizon, self.config.skill_draw);
        SkillSource { prior, decoder: self.decoder_policy(device), horizon, draw }
    }

    /// Returns the network that the policy is tied to, as a policy.
    pub(super) fn origin_policy(&self, device: DeviceKind) -> Policy {
        match self.tied_to {
            TiedTo::Decoder => self.decoder_policy(device),
            TiedTo::Prior => self.policy_of(&self.actors.prior, self.description.prior_spec(), device),
        }
    }

    /// Returns the decoder as a policy.
    pub(crate) fn decoder_policy(&self, device: DeviceKind) -> Policy {
        self.policy_of(&self.actors.decoder, self.description.decoder_spec(), device)
    }

    fn policy_of(&self, actor: &Actor, spec: PolicySpec, device: DeviceKind) -> Policy {
        Policy::new(actor, None, self.stats.clone(), spec, device.plain())
    }
}

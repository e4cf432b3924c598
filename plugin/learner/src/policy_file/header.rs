//! The header of a policy file: the shapes of its networks, by which they are read.

use crate::file::TensorFile;
use crate::nn::CnnKind;
use crate::norm::{ObsStats, take_obs_stats};
use crate::policy::{ActorShape, InputWidths, NetShape, Policy};
use crate::skill::{Prior, SKILL_STATS, SkillDraw, SkillSource};
use crate::{ActionSpace, DeviceKind, FileError, ImageShape, LearnError, ObsKind, PolicySpec};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

const NORMALISED_IMAGES: &str = "normalises images, whose pixels are divided by 255 instead";
const NO_HORIZON: &str = "the skill interval must be at least 1 tick, not 0";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PolicyShape {
    action_space: ActionSpace,
    /// Size of the images that it observes; `None` for vectors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    image: Option<ImageShape>,
    actor: ActorShape,
    critic: Option<NetShape>,
    normalised: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SkillsShape {
    latent: usize,
    tanh: bool,
    /// `None` is a standard normal.
    prior: Option<ActorShape>,
    decoder: ActorShape,
    horizon: usize,
    draw: SkillDraw,
    /// True if decoder and prior see normalised observations.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    normalised: bool,
}

impl PolicyShape {
    /// Returns the shape of `policy`.
    pub(super) fn of(policy: &Policy) -> Self {
        let image = match policy.observation() {
            ObsKind::Vector(_) => None,
            ObsKind::Image(image) => Some(image),
        };
        let actor = ActorShape::of(&policy.actor, policy.latent());
        Self {
            action_space: policy.action_space(),
            image,
            critic: policy.critic.as_ref().map(|critic| actor.critic(critic)),
            actor,
            normalised: policy.stats.is_some(),
        }
    }

    /// Returns the inputs and outputs of the policy.
    pub(super) fn spec(&self) -> PolicySpec {
        let net = &self.actor.net;
        PolicySpec {
            obs: self.image.map_or(ObsKind::Vector(net.obs_dim), ObsKind::Image),
            latent: net.latent,
            action_space: self.action_space,
        }
    }

    /// Reads the policy of this shape out of `file` and checks that its networks fit each other.
    pub(super) fn take(&self, file: &mut TensorFile, device: DeviceKind) -> Result<Policy, FileError> {
        let (spec, plain) = (self.spec(), device.plain());
        let actor = self.actor.stored(&spec, file, "actor", &plain)?;
        check_normaliser(self.normalised, &spec, file)?;
        let critic = match &self.critic {
            None => None,
            Some(critic) => {
                self.actor.net.input_widths().check(file, "critic", critic.input_widths())?;
                Some(critic.stored_critic(file, "critic", &plain)?)
            }
        };
        let stats = take_stats(self.normalised, file, "obs_norm", spec.obs.numbers())?;
        Ok(Policy::new(&actor, critic.as_ref(), stats, spec, plain))
    }
}

impl SkillsShape {
    /// Returns the shape of `skills`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if their skill interval is 0, or if prior and decoder have different observations.
    pub(super) fn of(skills: &SkillSource) -> Result<Self, LearnError> {
        if skills.horizon == 0 {
            return Err(LearnError::Config(NO_HORIZON.to_owned()));
        }
        let (decoder, prior) = (&skills.decoder, &skills.prior.net);
        if prior.as_ref().is_some_and(|prior| prior.stats != decoder.stats) {
            let text = "prior and decoder normalise observations in different ways: they must be of one skill model";
            return Err(LearnError::Config(text.to_owned()));
        }
        Ok(Self {
            latent: skills.prior.latent(),
            tanh: skills.prior.tanh,
            prior: prior.as_ref().map(|net| ActorShape::of(&net.actor, 0)),
            decoder: ActorShape::of(&decoder.actor, decoder.latent()),
            horizon: skills.horizon,
            draw: skills.draw,
            normalised: decoder.stats.is_some(),
        })
    }

    /// Reads the skills of this shape out of `file` and checks that their networks fit each other and the `policy`.
    pub(super) fn take(
        &self,
        file: &mut TensorFile,
        policy: &PolicySpec,
        device: DeviceKind,
    ) -> Result<SkillSource, FileError> {
        if self.horizon == 0 {
            return Err(file.format(NO_HORIZON.to_owned()));
        }
        check_normaliser(self.normalised, policy, file)?;
        let (latent, plain) = (self.latent, device.plain());
        // Networks of images each have features of their own.
        let obs_dim = |shape: &ActorShape| shape.cnn.as_ref().map_or(policy.obs.numbers(), CnnKind::features);
        let decoder_spec = PolicySpec { latent, ..*policy };
        let decoder = self.decoder.stored(&decoder_spec, file, "decoder", &plain)?;
        let widths = InputWidths { obs_dim: obs_dim(&self.decoder), latent };
        widths.check(file, "decoder", self.decoder.net.input_widths())?;
        if latent == 0 || ![0, latent].contains(&policy.latent) {
            return Err(file.format(format!("skills are {latent} wide, but the policy reads {}", policy.latent)));
        }
        let prior = match &self.prior {
            None => None,
            Some(shape) => {
                let spec = PolicySpec { latent: 0, action_space: ActionSpace::Continuous(latent), ..*policy };
                let prior = shape.stored(&spec, file, "prior", &plain)?;
                let widths = InputWidths { obs_dim: obs_dim(shape), latent: 0 };
                widths.check(file, "prior", shape.net.input_widths())?;
                Some(prior)
            }
        };
        let stats = take_stats(self.normalised, file, SKILL_STATS, policy.obs.numbers())?;
        let prior = match prior {
            None => Prior::standard_normal(latent, self.tanh),
            Some(net) => Prior::learned(&net, stats.clone(), policy.obs, latent, self.tanh, plain.clone()),
        };
        let decoder = Policy::new(&decoder, None, stats, decoder_spec, plain);
        Ok(SkillSource { prior, decoder, horizon: self.horizon, draw: self.draw })
    }
}

fn check_normaliser(normalised: bool, spec: &PolicySpec, file: &TensorFile) -> Result<(), FileError> {
    match spec.obs {
        ObsKind::Image(_) if normalised => Err(file.format(NORMALISED_IMAGES.to_owned())),
        _ => Ok(()),
    }
}

/// Reads the frozen normaliser called `name` out of a file, if there is one.
fn take_stats(
    normalised: bool,
    file: &mut TensorFile,
    name: &str,
    width: usize,
) -> Result<Option<Arc<ObsStats>>, FileError> {
    Ok(if normalised { Some(Arc::new(take_obs_stats(file, name, width)?)) } else { None })
}

//! What the header of a policy file says about its networks.

use super::file::SKILL_STATS;
use super::{Actor, Critic, LogStd, NetShape, Policy, SkillSource, StdKind};
use crate::file::TensorFile;
use crate::layout::{check_actor, check_cnn, check_mlp, joined_width};
use crate::nn::{CnnKind, ImageNet, Mlp, path};
use crate::norm::take_obs_stats;
use crate::rng::Streams;
use crate::skill::{Prior, SkillDraw};
use crate::{ActionSpace, DeviceKind, FileError, ImageShape, LearnError, ObsKind};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PolicyShape {
    pub(super) action_space: ActionSpace,
    /// Size of the images that it observes; `None` for vectors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    image: Option<ImageShape>,
    pub(super) actor: ActorShape,
    pub(super) critic: Option<NetShape>,
    pub(super) normalised: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ActorShape {
    pub(super) net: NetShape,
    std: StdShape,
    /// The trunk that reads images; `None` for vectors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cnn: Option<CnnKind>,
}

/// How an actor's standard deviation is made; without meaning for discrete actions.
#[derive(Serialize, Deserialize)]
enum StdShape {
    Vector,
    State,
    Squashed(f64, f64),
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
    /// Whether decoder and prior see normalised observations.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    normalised: bool,
}

impl PolicyShape {
    /// The shape of `policy`.
    pub(super) fn of(policy: &Policy) -> Self {
        let image = match policy.observation() {
            ObsKind::Vector(_) => None,
            ObsKind::Image(image) => Some(image),
        };
        let obs_dim = policy.actor.obs_dim(policy.latent);
        Self {
            action_space: policy.space,
            image,
            actor: ActorShape::of(&policy.actor, obs_dim),
            critic: policy.critic.as_ref().map(|critic| net_shape(&critic.net, obs_dim)),
            normalised: policy.stats.is_some(),
        }
    }

    /// What the policy observes.
    pub(super) fn observation(&self) -> ObsKind {
        self.image.map_or(ObsKind::Vector(self.actor.net.obs_dim), ObsKind::Image)
    }

    /// `Ok` if `file` holds networks of this shape that go together.
    pub(super) fn check(&self, file: &TensorFile) -> Result<(), FileError> {
        let net = &self.actor.net;
        self.actor.check(file, "actor", self.action_space, self.image)?;
        if self.normalised && self.image.is_some() {
            return Err(file.format(NORMALISED_IMAGES.to_owned()));
        }
        let Some(critic) = &self.critic else { return Ok(()) };
        same_widths(file, "critic", (critic.obs_dim, critic.latent), (net.obs_dim, net.latent))?;
        check_mlp(file, "critic", (joined_width(file, "critic", critic)?, &critic.hidden, 1))
    }

    /// Actor and critic of this shape, to be filled from a file.
    ///
    /// # Errors
    /// [`LearnError::Config`] if images are too small for the convolutions.
    pub(super) fn build(&self, device: DeviceKind) -> Result<(Actor, Option<Critic>), LearnError> {
        let critic = |net| Critic::new(net, &mut Streams::new(0).stream("", 0), &device.plain());
        Ok((self.actor.build(self.action_space, self.image, device)?, self.critic.as_ref().map(critic)))
    }
}

impl SkillsShape {
    /// The shape of `skills`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if they are held for no time, or if prior and decoder do not see the same.
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
            prior: prior.as_ref().map(|net| ActorShape::of(&net.actor, net.actor.obs_dim(0))),
            decoder: ActorShape::of(&decoder.actor, decoder.actor.obs_dim(decoder.latent)),
            horizon: skills.horizon,
            draw: skills.draw,
            normalised: decoder.stats.is_some(),
        })
    }

    /// `Ok` if `file` holds networks of this shape that go together and with `policy`.
    pub(super) fn check(&self, file: &TensorFile, policy: &PolicyShape) -> Result<(), FileError> {
        if self.horizon == 0 {
            return Err(file.format(NO_HORIZON.to_owned()));
        }
        if self.normalised && policy.image.is_some() {
            return Err(file.format(NORMALISED_IMAGES.to_owned()));
        }
        let (net, latent) = (&policy.actor.net, self.latent);
        self.decoder.check(file, "decoder", policy.action_space, policy.image)?;
        let widths = |net: &NetShape| (net.obs_dim, net.latent);
        // Networks of images each have features of their own.
        let obs_dim = |shape: &ActorShape| shape.cnn.as_ref().map_or(net.obs_dim, CnnKind::features);
        same_widths(file, "decoder", widths(&self.decoder.net), (obs_dim(&self.decoder), latent))?;
        if latent == 0 || ![0, latent].contains(&net.latent) {
            return Err(file.format(format!("skills are {latent} wide, but the policy reads {}", net.latent)));
        }
        let Some(prior) = &self.prior else { return Ok(()) };
        prior.check(file, "prior", ActionSpace::Continuous(latent), policy.image)?;
        same_widths(file, "prior", widths(&prior.net), (obs_dim(prior), 0))
    }

    pub(super) fn take(
        self,
        file: &mut TensorFile,
        policy: &PolicyShape,
        device: DeviceKind,
    ) -> Result<SkillSource, FileError> {
        let (plain, space, observation) = (device.plain(), policy.action_space, policy.observation());
        let decoder = self.decoder.take(file, "decoder", space, policy.image, device)?;
        let stats = match self.normalised {
            false => None,
            true => Some(Arc::new(take_obs_stats(file, SKILL_STATS, observation.numbers())?)),
        };
        let prior = match &self.prior {
            None => Prior::standard_normal(self.latent, self.tanh),
            Some(shape) => {
                let space = ActionSpace::Continuous(self.latent);
                let net = shape.take(file, "prior", space, policy.image, device)?;
                Prior::learned(&net, stats.clone(), observation, (self.latent, self.tanh), plain.clone())
            }
        };
        let decoder = Policy::new(&decoder, None, stats, space, (observation, self.latent), plain);
        Ok(SkillSource { prior, decoder, horizon: self.horizon, draw: self.draw })
    }
}

impl ActorShape {
    fn of(actor: &Actor, obs_dim: usize) -> Self {
        let std = match actor.log_std {
            LogStd::None | LogStd::Vector(_) => StdShape::Vector,
            LogStd::State(_) => StdShape::State,
            LogStd::Squashed { range: (low, high), .. } => StdShape::Squashed(low, high),
        };
        Self { net: net_shape(&actor.net, obs_dim), std, cnn: actor.cnn.as_ref().map(ImageNet::kind) }
    }

    /// `Ok` if `file` holds an actor of this shape, called `prefix`, that observes `image`s, or vectors, and acts in
    /// `space`.
    fn check(
        &self,
        file: &TensorFile,
        prefix: &str,
        space: ActionSpace,
        image: Option<ImageShape>,
    ) -> Result<(), FileError> {
        match (&self.cnn, image) {
            (None, None) => {}
            (Some(cnn), Some(image)) => {
                check_cnn(file, &path(prefix, "cnn"), cnn, image)?;
                let widths = |obs_dim| (obs_dim, self.net.latent);
                same_widths(file, prefix, widths(self.net.obs_dim), widths(cnn.features()))?;
            }
            (None, Some(_)) => return Err(file.format(format!("`{prefix}` reads vectors, but must read images"))),
            (Some(_), None) => return Err(file.format(format!("`{prefix}` reads images, but must read vectors"))),
        }
        check_actor(file, prefix, &self.net, space, !matches!(self.std, StdShape::Vector))
    }

    /// An actor of this shape, to be filled from a file.
    fn build(&self, space: ActionSpace, image: Option<ImageShape>, device: DeviceKind) -> Result<Actor, LearnError> {
        let (rng, device) = (&mut Streams::new(0).stream("", 0), &device.plain());
        let actor = match self.std {
            StdShape::Vector => Actor::new(&self.net, space, StdKind::Vector, rng, device),
            StdShape::State => Actor::new(&self.net, space, StdKind::State, rng, device),
            StdShape::Squashed(low, high) => Actor::squashed(&self.net, space, (low, high), rng, device),
        };
        Ok(match self.cnn.as_ref().zip(image) {
            Some((cnn, image)) => actor.with_cnn(ImageNet::new(cnn, image, rng, device)?),
            None => actor,
        })
    }

    /// The actor of this shape called `prefix`, out of a file.
    fn take(
        &self,
        file: &mut TensorFile,
        prefix: &str,
        space: ActionSpace,
        image: Option<ImageShape>,
        device: DeviceKind,
    ) -> Result<Actor, FileError> {
        let mut actor = self.build(space, image, device).map_err(|e| file.learner(e))?;
        file.take_network(prefix, &mut actor, &device.plain())?;
        Ok(actor)
    }
}

const NORMALISED_IMAGES: &str = "normalises images, whose pixels are divided by 255 instead";
const NO_HORIZON: &str = "a skill must be held for at least 1 tick, not 0";

/// `Ok` if the network `name` reads observations and skills as wide as the others do.
fn same_widths(
    file: &TensorFile,
    name: &str,
    found: (usize, usize),
    expected: (usize, usize),
) -> Result<(), FileError> {
    if found == expected {
        return Ok(());
    }
    let text = |(obs_dim, latent)| format!("observations of {obs_dim} and skills of {latent}");
    Err(file.format(format!("`{name}` reads {}, but must read {}", text(found), text(expected))))
}

/// The sizes of `net`, which reads observations of `obs_dim` behind its skills.
fn net_shape(net: &Mlp, obs_dim: usize) -> NetShape {
    NetShape {
        obs_dim,
        latent: net.inputs() - obs_dim,
        hidden: net.layers.iter().map(|layer| layer.weight.dims()[1]).collect(),
        activation: net.activation,
    }
}

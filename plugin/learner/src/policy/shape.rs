//! What the header of a policy file says about its networks.

use super::{Actor, Critic, LogStd, NetShape, Policy, SkillSource, StdKind};
use crate::file::TensorFile;
use crate::layout::{check_actor, check_mlp, joined_width};
use crate::nn::Mlp;
use crate::rng::Streams;
use crate::skill::{Prior, SkillDraw};
use crate::{ActionSpace, DeviceKind, FileError, LearnError};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PolicyShape {
    pub(super) action_space: ActionSpace,
    pub(super) actor: ActorShape,
    pub(super) critic: Option<NetShape>,
    pub(super) normalised: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ActorShape {
    pub(super) net: NetShape,
    std: StdShape,
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
}

impl PolicyShape {
    /// The shape of `policy`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if it reads images.
    pub(super) fn of(policy: &Policy) -> Result<Self, LearnError> {
        let obs_dim = policy.observation().vector("a policy file")?;
        Ok(Self {
            action_space: policy.space,
            actor: ActorShape::of(&policy.actor, obs_dim),
            critic: policy.critic.as_ref().map(|critic| net_shape(&critic.net, obs_dim)),
            normalised: policy.stats.is_some(),
        })
    }

    /// `Ok` if `file` holds networks of this shape that go together.
    pub(super) fn check(&self, file: &TensorFile) -> Result<(), FileError> {
        let net = &self.actor.net;
        self.actor.check(file, "actor", self.action_space)?;
        let Some(critic) = &self.critic else { return Ok(()) };
        same_widths(file, "critic", (critic.obs_dim, critic.latent), (net.obs_dim, net.latent))?;
        check_mlp(file, "critic", (joined_width(file, "critic", critic)?, &critic.hidden, 1))
    }

    /// Actor and critic of this shape, to be filled from a file.
    pub(super) fn build(&self, device: DeviceKind) -> (Actor, Option<Critic>) {
        let critic = |net| Critic::new(net, &mut Streams::new(0).stream("", 0), &device.plain());
        (self.actor.build(self.action_space, device), self.critic.as_ref().map(critic))
    }
}

impl SkillsShape {
    /// The shape of `skills`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if they read images or are held for no time.
    pub(super) fn of(skills: &SkillSource) -> Result<Self, LearnError> {
        if skills.horizon == 0 {
            return Err(LearnError::Config(NO_HORIZON.to_owned()));
        }
        let prior = match &skills.prior.net {
            None => None,
            Some((net, obs, _)) => Some(ActorShape::of(net, obs.vector("a policy file's prior")?)),
        };
        Ok(Self {
            latent: skills.prior.latent(),
            tanh: skills.prior.tanh,
            prior,
            decoder: ActorShape::of(
                &skills.decoder.actor,
                skills.decoder.observation().vector("a policy file's decoder")?,
            ),
            horizon: skills.horizon,
            draw: skills.draw,
        })
    }

    /// `Ok` if `file` holds networks of this shape that go together and with `policy`.
    pub(super) fn check(&self, file: &TensorFile, policy: &PolicyShape) -> Result<(), FileError> {
        if self.horizon == 0 {
            return Err(file.format(NO_HORIZON.to_owned()));
        }
        let (net, latent) = (&policy.actor.net, self.latent);
        self.decoder.check(file, "decoder", policy.action_space)?;
        let widths = |net: &NetShape| (net.obs_dim, net.latent);
        same_widths(file, "decoder", widths(&self.decoder.net), (net.obs_dim, latent))?;
        if latent == 0 || ![0, latent].contains(&net.latent) {
            return Err(file.format(format!("skills are {latent} wide, but the policy reads {}", net.latent)));
        }
        let Some(prior) = &self.prior else { return Ok(()) };
        prior.check(file, "prior", ActionSpace::Continuous(latent))?;
        same_widths(file, "prior", widths(&prior.net), (net.obs_dim, 0))
    }

    pub(super) fn take(
        self,
        file: &mut TensorFile,
        space: ActionSpace,
        device: DeviceKind,
    ) -> Result<SkillSource, FileError> {
        let plain = device.plain();
        let mut decoder = self.decoder.build(space, device);
        file.take_network("decoder", &mut decoder, &plain)?;
        let prior = match &self.prior {
            None => Prior::standard_normal(self.latent, self.tanh),
            Some(shape) => {
                let mut net = shape.build(ActionSpace::Continuous(self.latent), device);
                file.take_network("prior", &mut net, &plain)?;
                Prior::learned(&net, shape.net.obs_dim, self.latent, self.tanh, plain.clone())
            }
        };
        let widths = (self.decoder.net.obs_dim, self.decoder.net.latent);
        let decoder = Policy::new(&decoder, None, None, space, widths, plain);
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
        Self { net: net_shape(&actor.net, obs_dim), std }
    }

    /// `Ok` if `file` holds an actor of this shape, called `prefix`, that acts in `space`.
    fn check(&self, file: &TensorFile, prefix: &str, space: ActionSpace) -> Result<(), FileError> {
        check_actor(file, prefix, &self.net, space, !matches!(self.std, StdShape::Vector))
    }

    /// An actor of this shape, to be filled from a file.
    fn build(&self, space: ActionSpace, device: DeviceKind) -> Actor {
        let (rng, device) = (&mut Streams::new(0).stream("", 0), &device.plain());
        match self.std {
            StdShape::Vector => Actor::new(&self.net, space, StdKind::Vector, rng, device),
            StdShape::State => Actor::new(&self.net, space, StdKind::State, rng, device),
            StdShape::Squashed(low, high) => Actor::squashed(&self.net, space, (low, high), rng, device),
        }
    }
}

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

//! A policy that a game ships with: one self-describing file.

use super::{Actor, Critic, LogStd, NetShape, Policy, StdKind};
use crate::file::TensorFile;
use crate::nn::Mlp;
use crate::norm::ObsStats;
use crate::rng::Streams;
use crate::skill::{Prior, SkillDraw};
use crate::{ActionSpace, DeviceKind, FileError, LearnError};
use serde::{Deserialize, Serialize};
use std::path::Path;

const KIND: &str = "policy";
const VERSION: u32 = 1;

/// How far an example may be from what it was, absolutely and relatively: other processors round otherwise.
const TOLERANCE: f32 = 1e-3;

/// What a policy was made for and by, for people and for checks.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub struct PolicyCard {
    /// Name of the game.
    pub game: String,
    /// Version of the game's rules.
    pub game_version: u32,
    /// Names of the observation's values, in order.
    pub observations: Vec<String>,
    /// Names of the discrete choices or of the action vector's dimensions; may be empty.
    pub actions: Vec<String>,
    /// Name of the algorithm.
    pub algorithm: String,
    /// What it was trained on, and for how long.
    pub training: String,
    /// Version and revision of the code that wrote the file.
    pub code: String,
}

/// Where a policy's skills come from, and the decoder it is tied to.
#[derive(Clone, Debug)]
pub struct SkillSource {
    /// p(z | s).
    pub prior: Prior,
    /// The skill model's decoder, without a critic; behaviour cloning if it plays instead of the policy.
    pub decoder: Policy,
    /// Ticks for which a skill is held (the paper's T).
    pub horizon: usize,
    /// Whether skills are drawn or are the prior's mean.
    pub draw: SkillDraw,
}

/// A policy with everything it needs to play.
///
/// The file is safetensors: networks, normaliser and some rows of observations with what the policy said about them,
/// and a description as JSON in the header. A reader that computes something else for those rows refuses the file.
#[derive(Clone, Debug)]
pub struct PolicyFile {
    /// What it was made for and by.
    pub card: PolicyCard,
    /// The policy.
    pub policy: Policy,
    /// Its skills, if it reads any.
    pub skills: Option<SkillSource>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    kind: String,
    version: u32,
    card: PolicyCard,
    policy: PolicyShape,
    skills: Option<SkillsShape>,
    examples: usize,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PolicyShape {
    action_space: ActionSpace,
    actor: ActorShape,
    critic: Option<NetShape>,
    normalised: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ActorShape {
    net: NetShape,
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
struct SkillsShape {
    latent: usize,
    tanh: bool,
    /// `None` is a standard normal.
    prior: Option<ActorShape>,
    decoder: ActorShape,
    horizon: usize,
    draw: SkillDraw,
}

impl PolicyFile {
    /// Writes the file, in one step. `obs` (`n * obs_dim`, raw) and `z` (`n * latent`) are the rows by which readers check
    /// themselves; a few that the policy meets in play are enough.
    ///
    /// # Errors
    /// [`FileError::Learner`] if the rows do not fit the policy, [`FileError::Io`] if the file cannot be written.
    pub fn save(&self, path: &Path, obs: &[f32], z: &[f32], n: usize) -> Result<(), FileError> {
        let policy = &self.policy;
        let vector = policy.observation().vector("a policy file");
        let obs_dim = vector.map_err(|source| FileError::Learner { path: path.to_owned(), source })?;
        let header = Header {
            kind: KIND.to_owned(),
            version: VERSION,
            card: self.card.clone(),
            policy: PolicyShape {
                action_space: policy.space,
                actor: ActorShape::of(&policy.actor, obs_dim),
                critic: policy.critic.as_ref().map(|critic| net_shape(&critic.net, obs_dim)),
                normalised: policy.stats.is_some(),
            },
            skills: self.skills.as_ref().map(SkillsShape::of),
            examples: n,
        };
        let mut file = TensorFile::new(path, &header)?;
        file.put_network("actor", &policy.actor)?;
        if let Some(critic) = &policy.critic {
            file.put_network("critic", critic)?;
        }
        if let Some(stats) = &policy.stats {
            file.put_f64("obs_norm.mean", &stats.mean);
            file.put_f64("obs_norm.inv_std", &stats.inv_std);
        }
        if let Some(skills) = &self.skills {
            file.put_network("decoder", &skills.decoder.actor)?;
            if let Some((net, ..)) = &skills.prior.net {
                file.put_network("prior", net)?;
            }
        }
        file.put("examples.obs", &[n, obs_dim], obs);
        file.put("examples.z", &[n, policy.latent], if policy.latent == 0 { &[] } else { z });
        let examples = self.examples(obs, z, n).map_err(|source| file.learner(source))?;
        for (name, width, values) in examples {
            file.put(&format!("examples.{name}"), &[n, width], &values);
        }
        file.write()
    }

    /// Reads a file that [`Self::save`] wrote, and checks that it says of its examples what it said when it was written.
    ///
    /// # Errors
    /// [`FileError`] says what is wrong with the file, names the tensor that is missing, superfluous or misshapen, or the
    /// example that came out otherwise.
    pub fn load(path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        Self::take(TensorFile::read(path)?, device)
    }

    /// [`Self::load`] for a file that is in memory already, such as an asset or `include_bytes!`; `name` is for messages.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn from_bytes(name: &Path, bytes: &[u8], device: DeviceKind) -> Result<Self, FileError> {
        Self::take(TensorFile::parse(name, bytes)?, device)
    }

    fn take(mut file: TensorFile, device: DeviceKind) -> Result<Self, FileError> {
        let header: Header = file.description(KIND, VERSION)?;
        let shape = header.policy;
        let plain = device.plain();
        let mut actor = shape.actor.build(shape.action_space, device);
        file.take_network("actor", &mut actor, &plain)?;
        let mut critic = shape.critic.as_ref().map(|net| Critic::new(net, &mut Streams::new(0).stream("", 0), &plain));
        if let Some(critic) = &mut critic {
            file.take_network("critic", critic, &plain)?;
        }
        let net = &shape.actor.net;
        let stats = match shape.normalised {
            false => None,
            true => Some(ObsStats {
                mean: file.take_f64("obs_norm.mean", Some(net.obs_dim))?,
                inv_std: file.take_f64("obs_norm.inv_std", Some(net.obs_dim))?,
            }),
        };
        let widths = (net.obs_dim, net.latent);
        let policy = Policy::new(&actor, critic.as_ref(), stats, shape.action_space, widths, plain);
        let skills = match header.skills {
            None => None,
            Some(skills) => Some(skills.take(&mut file, shape.action_space, device)?),
        };
        let read = Self { card: header.card, policy, skills };
        read.prove(&mut file, header.examples)?;
        file.finish()?;
        Ok(read)
    }

    /// Compares what the policy says of the stored examples with what is stored.
    fn prove(&self, file: &mut TensorFile, n: usize) -> Result<(), FileError> {
        let obs = file.take("examples.obs", &[n, self.policy.obs_dim()])?;
        let z = file.take("examples.z", &[n, self.policy.latent])?;
        let examples = self.examples(&obs, &z, n).map_err(|source| file.learner(source))?;
        for (what, width, found) in examples {
            let expected = file.take(&format!("examples.{what}"), &[n, width])?;
            let same = |(a, b): (&f32, &f32)| a == b || (a - b).abs() <= TOLERANCE * (1.0 + a.abs());
            if let Some(at) = expected.iter().zip(&found).position(|pair| !same(pair)) {
                return Err(FileError::Example {
                    path: file.path().to_owned(),
                    example: at / width.max(1),
                    what,
                    expected: expected[at],
                    found: found[at],
                });
            }
        }
        Ok(())
    }

    /// What the policy says of `n` rows: name, numbers per row, numbers.
    fn examples(&self, obs: &[f32], z: &[f32], n: usize) -> Result<Vec<(&'static str, usize, Vec<f32>)>, LearnError> {
        let output = self.policy.forward(z, obs, n)?;
        let dim = self.policy.space.dim();
        let std_width = if output.log_std.is_empty() { 0 } else { dim };
        let mut all =
            vec![("head", dim, output.head), ("log_std", std_width, output.log_std), ("value", 1, output.values)];
        if let Some(skills) = &self.skills {
            let mean = skills.prior.sample(obs, n, SkillDraw::Mean, &mut |_| 0.0)?;
            all.push(("prior_mean", skills.prior.latent(), mean));
        }
        Ok(all)
    }
}

impl SkillsShape {
    fn of(skills: &SkillSource) -> Self {
        Self {
            latent: skills.prior.latent(),
            tanh: skills.prior.tanh,
            prior: skills.prior.net.as_ref().map(|(net, obs, _)| ActorShape::of(net, obs.numbers())),
            decoder: ActorShape::of(&skills.decoder.actor, skills.decoder.obs_dim()),
            horizon: skills.horizon,
            draw: skills.draw,
        }
    }

    fn take(self, file: &mut TensorFile, space: ActionSpace, device: DeviceKind) -> Result<SkillSource, FileError> {
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

fn net_shape(net: &Mlp, obs_dim: usize) -> NetShape {
    NetShape {
        obs_dim,
        latent: net.inputs() - obs_dim,
        hidden: net.layers.iter().map(|layer| layer.weight.dims()[1]).collect(),
        activation: net.activation,
    }
}

//! Policies that a game ships with, each in one self-describing file.

use crate::{
    ActionSpace, DeviceKind, FileError, ImageShape, LearnError, ObsKind, ObsSlice, Observations, PictureMetadata,
    PolicySpec, SeenLevels,
    file::{FileKind, TensorFile},
    norm::{ObsStats, put_obs_stats, take_obs_stats},
    policy::{ActorShape, InputWidths, NetShape, Policy, StateBatch},
    skill::{Prior, SKILL_STATS, SkillDraw, SkillSource},
};
use serde::{Deserialize, Serialize};
use std::{path::Path, sync::Arc};

const FILE: FileKind = FileKind { name: "policy", version: 1 };

/// Advice on recovering a policy file that is cut off.
const AGAIN: &str = ": export the policy again";

/// A policy with everything it needs to play.
///
/// The file is safetensors: networks, normaliser, some rows of observations with the policy's outputs for them, and a
/// description as JSON in the header. A reader with other results for those rows refuses the file.
#[derive(Clone, Debug)]
pub struct PolicyFile {
    /// Its metadata.
    pub metadata: PolicyMetadata,
    /// The policy.
    pub policy: Policy,
    /// Its skills, if it reads any.
    pub skills: Option<SkillSource>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    #[serde(rename = "card")]
    metadata: PolicyMetadata,
    policy: PolicyShape,
    skills: Option<SkillsShape>,
    examples: usize,
}

impl PolicyFile {
    /// Writes the file, in one step. `obs` (`n`, raw) and `z` (`n * latent`) are the rows by which readers check
    /// themselves; a few observations from play are enough.
    ///
    /// # Errors
    /// [`FileError::Learner`] if the rows do not fit the policy, [`FileError::Io`] if the file cannot be written.
    pub fn save<'a>(&self, path: &Path, obs: impl Into<ObsSlice<'a>>, z: &[f32], n: usize) -> Result<(), FileError> {
        let (policy, obs) = (&self.policy, obs.into());
        let learner = |source| FileError::Learner { path: path.to_owned(), source };
        if n == 0 {
            let text = "a policy file needs at least one example row for the checks of its readers";
            return Err(learner(LearnError::Config(text.to_owned())));
        }
        if let Some(picture) = &self.metadata.picture {
            picture.check(policy.observation()).map_err(learner)?;
        }
        let header = Header {
            metadata: self.metadata.clone(),
            policy: PolicyShape::of(policy),
            skills: self.skills.as_ref().map(SkillsShape::of).transpose().map_err(learner)?,
            examples: n,
        };
        let states = StateBatch { z, left: &[], memory: &[], obs, n };
        let examples = Examples::of(self, states).map_err(learner)?;
        let mut file = TensorFile::new(path, FILE, &header)?;
        file.put_network("actor", &policy.actor)?;
        if let Some(critic) = &policy.critic {
            file.put_network("critic", critic)?;
        }
        if let Some(stats) = &policy.stats {
            put_obs_stats(&mut file, "obs_norm", stats);
        }
        if let Some(skills) = &self.skills {
            file.put_network("decoder", &skills.decoder.actor)?;
            if let Some(net) = &skills.prior.net {
                file.put_network("prior", &net.actor)?;
            }
            if let Some(stats) = &skills.decoder.stats {
                put_obs_stats(&mut file, SKILL_STATS, stats);
            }
        }
        examples.put(&mut file, policy, states);
        file.write()
    }

    /// Reads a file that [`Self::save`] wrote, and checks that its outputs for the examples are the stored ones.
    ///
    /// # Errors
    /// [`FileError`] describes the problem of the file, or names the tensor that is missing, superfluous or
    /// misshapen, or the example with another result.
    pub fn load(path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        Self::take(TensorFile::read(path).map_err(|error| error.or_again(AGAIN))?, device)
    }

    /// Reads a file in memory as [`Self::load`] does, such as an asset or `include_bytes!`; `name` is for messages.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn from_bytes(name: &Path, bytes: &[u8], device: DeviceKind) -> Result<Self, FileError> {
        Self::take(TensorFile::parse(name, bytes).map_err(|error| error.or_again(AGAIN))?, device)
    }

    fn take(mut file: TensorFile, device: DeviceKind) -> Result<Self, FileError> {
        let header: Header = file.header(FILE)?;
        device.check().map_err(|e| file.learner(e))?;
        let spec = header.policy.spec();
        let policy = header.policy.take(&mut file, device)?;
        let skills = match header.skills {
            None => None,
            Some(skills) => Some(skills.take(&mut file, &spec, device)?),
        };
        if header.examples == 0 {
            return Err(file.format("holds no examples for the checks of its readers".to_owned()));
        }
        if let Some(picture) = &header.metadata.picture {
            picture.check(spec.obs).map_err(|e| file.learner(e))?;
        }
        let read = Self { metadata: header.metadata, policy, skills };
        Examples::check(&read, &mut file, header.examples)?;
        file.finish()?;
        Ok(read)
    }
}

/// Metadata of a policy: its purpose and origin.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub struct PolicyMetadata {
    /// Name of the game.
    pub game: String,
    /// Version of the game's rules.
    pub game_version: u32,
    /// Names of the observation's values, in order; none for images.
    pub observations: Vec<String>,
    /// Metadata of the images that it observes; `None` for vectors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<PictureMetadata>,
    /// Names of the discrete choices or of the action vector's dimensions; may be empty.
    pub actions: Vec<String>,
    /// Name of the algorithm.
    pub algorithm: String,
    /// A description of the training and its length.
    pub training: String,
    /// The levels that it has seen, including those of its demonstrations; `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seen: Option<SeenLevels>,
    /// Version and revision of the code that wrote the file.
    pub code: String,
}

// The header of a policy file: the shapes of its networks, by which they are read.

const NORMALISED_IMAGES: &str = "normalises images, whose pixels are divided by 255 instead";

const NO_SKILL_INTERVAL: &str = "the skill interval must be at least 1 tick, not 0";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PolicyShape {
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
struct SkillsShape {
    latent: usize,
    tanh: bool,
    /// `None` is a standard normal.
    prior: Option<ActorShape>,
    decoder: ActorShape,
    #[serde(rename = "horizon")]
    skill_interval: usize,
    draw: SkillDraw,
    /// True if decoder and prior see normalised observations.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    normalised: bool,
}

impl PolicyShape {
    /// Returns the shape of `policy`.
    fn of(policy: &Policy) -> Self {
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
    fn spec(&self) -> PolicySpec {
        let net = &self.actor.net;
        PolicySpec {
            obs: self.image.map_or(ObsKind::Vector(self.actor.observed()), ObsKind::Image),
            latent: net.latent,
            action_space: self.action_space,
        }
    }

    /// Reads the policy of this shape out of `file` and checks that its networks fit each other.
    fn take(&self, file: &mut TensorFile, device: DeviceKind) -> Result<Policy, FileError> {
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
    fn of(skills: &SkillSource) -> Result<Self, LearnError> {
        if skills.skill_interval == 0 {
            return Err(LearnError::Config(NO_SKILL_INTERVAL.to_owned()));
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
            skill_interval: skills.skill_interval,
            draw: skills.draw,
            normalised: decoder.stats.is_some(),
        })
    }

    /// Reads the skills of this shape out of `file` and checks that their networks fit each other and the `policy`.
    fn take(&self, file: &mut TensorFile, policy: &PolicySpec, device: DeviceKind) -> Result<SkillSource, FileError> {
        if self.skill_interval == 0 {
            return Err(file.format(NO_SKILL_INTERVAL.to_owned()));
        }
        check_normaliser(self.normalised, policy, file)?;
        let (latent, plain) = (self.latent, device.plain());
        // Networks of images each have features of their own.
        let obs_dim = |shape: &ActorShape| match (&shape.cnn, &shape.entities) {
            (Some(cnn), _) => cnn.features(),
            (None, Some(entities)) => entities.features(),
            (None, None) => policy.obs.numbers(),
        };
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
                let seen = obs_dim(shape);
                let remembered = shape.memory.map_or(0, |memory| memory.width(seen));
                let widths = InputWidths { obs_dim: seen.saturating_add(remembered), latent: 0 };
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
        Ok(SkillSource { prior, decoder, skill_interval: self.skill_interval, draw: self.draw })
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

// Examples in a policy file, by which its reader checks that it computes the same numbers as the writer.

/// The examples' observations.
const OBSERVATIONS: &str = "examples.obs";

/// Tolerance of an example, absolute and relative: results are not equal on other CPUs.
const TOLERANCE: f32 = 1e-3;

/// One kind of output of a policy for each example.
struct Output {
    name: &'static str,
    /// Numbers of one example.
    width: usize,
    numbers: Vec<f32>,
}

/// All outputs of a policy, its decoder and its prior for some states.
struct Examples {
    outputs: Vec<Output>,
}

impl Examples {
    /// Returns the outputs of `file`'s networks for `states`.
    fn of(file: &PolicyFile, states: StateBatch<'_>) -> Result<Self, LearnError> {
        let StateBatch { z, obs, n, .. } = states;
        let output = file.policy.forward(z, obs, n)?;
        let (dim, of_std) = (file.policy.action_space().dim(), file.policy.action_space().numbers());
        let std =
            |name, numbers: Vec<f32>| Output { name, width: if numbers.is_empty() { 0 } else { of_std }, numbers };
        let mut outputs = vec![
            Output { name: "head", width: dim, numbers: output.head },
            std("log_std", output.log_std),
            Output { name: "value", width: 1, numbers: output.values },
        ];
        if let Some(skills) = &file.skills {
            let mean = skills.prior.sample(obs, n, SkillDraw::Mean, &mut |_| 0.0)?;
            // The skills that the policy reads or, if it reads none, those of the prior.
            let decoded = skills.decoder.forward(if file.policy.latent() > 0 { z } else { &mean }, obs, n)?;
            outputs.push(Output { name: "decoder_head", width: dim, numbers: decoded.head });
            outputs.push(std("decoder_log_std", decoded.log_std));
            outputs.push(Output { name: "prior_mean", width: skills.prior.latent(), numbers: mean });
        }
        Ok(Self { outputs })
    }

    /// Adds the outputs to a file, with their `states`.
    fn put(&self, file: &mut TensorFile, policy: &Policy, states: StateBatch<'_>) {
        let StateBatch { z, obs, n, .. } = states;
        let shape = [n, policy.obs_dim()];
        match obs {
            ObsSlice::Vector(values) => file.put(OBSERVATIONS, &shape, values),
            ObsSlice::Image(pixels) => file.put_bytes(OBSERVATIONS, &shape, pixels),
        }
        let latent = policy.latent();
        file.put("examples.z", &[n, latent], if latent == 0 { &[] } else { z });
        for Output { name, width, numbers } in &self.outputs {
            file.put(&format!("examples.{name}"), &[n, *width], numbers);
        }
    }

    /// Compares the outputs of the networks that were `read` for the `n` examples of their file with the stored ones.
    fn check(read: &PolicyFile, file: &mut TensorFile, n: usize) -> Result<(), FileError> {
        let policy = &read.policy;
        let shape = [n, policy.obs_dim()];
        let obs = match policy.observation() {
            ObsKind::Vector(_) => Observations::Vector(file.take(OBSERVATIONS, &shape)?),
            ObsKind::Image(_) => Observations::Image(file.take_bytes(OBSERVATIONS, &shape)?),
        };
        let z = file.take("examples.z", &[n, policy.latent()])?;
        let states = StateBatch { z: &z, left: &[], memory: &[], obs: obs.as_slice(), n };
        let examples = Self::of(read, states).map_err(|source| file.learner(source))?;
        for Output { name, width, numbers } in examples.outputs {
            let expected = file.take(&format!("examples.{name}"), &[n, width])?;
            let same = |(a, b): (&f32, &f32)| a == b || (a - b).abs() <= TOLERANCE * (1.0 + a.abs());
            if let Some(at) = expected.iter().zip(&numbers).position(|pair| !same(pair)) {
                return Err(FileError::Example {
                    path: file.path().to_owned(),
                    example: at / width.max(1),
                    what: name,
                    expected: expected[at],
                    found: numbers[at],
                });
            }
        }
        Ok(())
    }
}

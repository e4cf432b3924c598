//! A policy that a game ships with: one self-describing file.

use super::Policy;
use super::shape::{PolicyShape, SkillsShape};
use crate::file::TensorFile;
use crate::norm::{put_obs_stats, take_obs_stats};
use crate::skill::{Prior, SkillDraw};
use crate::{DeviceKind, FileError, LearnError, ObsKind, ObsSlice, Observations};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

const KIND: &str = "policy";
const VERSION: u32 = 1;
/// The frozen normaliser of decoder and prior.
pub(super) const SKILL_STATS: &str = "skill.obs_norm";
/// The examples' observations.
const OBSERVATIONS: &str = "examples.obs";

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
    /// Names of the observation's values, in order; none for images.
    pub observations: Vec<String>,
    /// How the images that it observes are made; `None` for vectors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<PictureCard>,
    /// Names of the discrete choices or of the action vector's dimensions; may be empty.
    pub actions: Vec<String>,
    /// Name of the algorithm.
    pub algorithm: String,
    /// What it was trained on, and for how long.
    pub training: String,
    /// Version and revision of the code that wrote the file.
    pub code: String,
}

/// How the images that a policy or a skill model observes are made: images of one shape can still show other things.
/// Their size is that of [`Policy::observation`], and the network that reads them is [`Policy::cnn`].
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub struct PictureCard {
    /// Name of the sensor that made them.
    pub sensor: String,
    /// How many successive pictures make an image, oldest first.
    pub stack: usize,
    /// One channel of brightness instead of red, green and blue.
    pub grayscale: bool,
    /// Whether the agent's velocity is painted into them.
    pub paint_velocity: bool,
}

impl PictureCard {
    /// Channels of an image.
    pub fn channels(&self) -> usize {
        self.stack * if self.grayscale { 1 } else { 3 }
    }

    /// `Ok` if a policy of `observation` can have this on its card.
    pub(crate) fn check(&self, observation: ObsKind) -> Result<(), LearnError> {
        match observation {
            ObsKind::Image(image) if image.channels == self.channels() => Ok(()),
            _ => Err(LearnError::Config(format!(
                "the card tells of {} pictures with {} channels together, but the policy observes {observation}",
                self.stack,
                self.channels()
            ))),
        }
    }
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

impl PolicyFile {
    /// Writes the file, in one step. `obs` (`n`, raw) and `z` (`n * latent`) are the rows by which readers check
    /// themselves; a few that the policy meets in play are enough.
    ///
    /// # Errors
    /// [`FileError::Learner`] if the rows do not fit the policy, [`FileError::Io`] if the file cannot be written.
    pub fn save<'a>(&self, path: &Path, obs: impl Into<ObsSlice<'a>>, z: &[f32], n: usize) -> Result<(), FileError> {
        let (policy, obs) = (&self.policy, obs.into());
        let learner = |source| FileError::Learner { path: path.to_owned(), source };
        if n == 0 {
            let text = "a policy file needs at least one row by which its readers check themselves";
            return Err(learner(LearnError::Config(text.to_owned())));
        }
        if let Some(picture) = &self.card.picture {
            picture.check(policy.observation()).map_err(learner)?;
        }
        let header = Header {
            kind: KIND.to_owned(),
            version: VERSION,
            card: self.card.clone(),
            policy: PolicyShape::of(policy),
            skills: self.skills.as_ref().map(SkillsShape::of).transpose().map_err(learner)?,
            examples: n,
        };
        let examples = self.examples(obs, z, n).map_err(learner)?;
        let mut file = TensorFile::new(path, &header)?;
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
        let shape = [n, policy.obs_dim()];
        match obs {
            ObsSlice::Vector(values) => file.put(OBSERVATIONS, &shape, values),
            ObsSlice::Image(pixels) => file.put_bytes(OBSERVATIONS, &shape, pixels),
        }
        file.put("examples.z", &[n, policy.latent], if policy.latent == 0 { &[] } else { z });
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
        shape.check(&file)?;
        if let Some(skills) = &header.skills {
            skills.check(&file, &shape)?;
        }
        if header.examples == 0 {
            return Err(file.format("holds no examples by which it could be checked".to_owned()));
        }
        let observation = shape.observation();
        if let Some(picture) = &header.card.picture {
            picture.check(observation).map_err(|e| file.learner(e))?;
        }
        let plain = device.plain();
        let (mut actor, mut critic) = shape.build(device).map_err(|e| file.learner(e))?;
        file.take_network("actor", &mut actor, &plain)?;
        if let Some(critic) = &mut critic {
            file.take_network("critic", critic, &plain)?;
        }
        let net = &shape.actor.net;
        let stats = match shape.normalised {
            false => None,
            true => Some(Arc::new(take_obs_stats(&mut file, "obs_norm", net.obs_dim)?)),
        };
        let widths = (observation, net.latent);
        let policy = Policy::new(&actor, critic.as_ref(), stats, shape.action_space, widths, plain);
        let skills = match header.skills {
            None => None,
            Some(skills) => Some(skills.take(&mut file, &shape, device)?),
        };
        let read = Self { card: header.card, policy, skills };
        read.prove(&mut file, header.examples)?;
        file.finish()?;
        Ok(read)
    }

    /// Compares what the policy says of the stored examples with what is stored.
    fn prove(&self, file: &mut TensorFile, n: usize) -> Result<(), FileError> {
        let shape = [n, self.policy.obs_dim()];
        let obs = match self.policy.observation() {
            ObsKind::Vector(_) => Observations::Vector(file.take(OBSERVATIONS, &shape)?),
            ObsKind::Image(_) => Observations::Image(file.take_bytes(OBSERVATIONS, &shape)?),
        };
        let z = file.take("examples.z", &[n, self.policy.latent])?;
        let examples = self.examples(obs.as_slice(), &z, n).map_err(|source| file.learner(source))?;
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
    fn examples(
        &self,
        obs: ObsSlice<'_>,
        z: &[f32],
        n: usize,
    ) -> Result<Vec<(&'static str, usize, Vec<f32>)>, LearnError> {
        let output = self.policy.forward(z, obs, n)?;
        let dim = self.policy.space.dim();
        let std_width = if output.log_std.is_empty() { 0 } else { dim };
        let mut all =
            vec![("head", dim, output.head), ("log_std", std_width, output.log_std), ("value", 1, output.values)];
        if let Some(skills) = &self.skills {
            let mean = skills.prior.sample(obs, n, SkillDraw::Mean, &mut |_| 0.0)?;
            // The skills that the policy reads or, if it reads none, those of the prior.
            let decoded = skills.decoder.forward(if self.policy.latent > 0 { z } else { &mean }, obs, n)?;
            let std_width = if decoded.log_std.is_empty() { 0 } else { dim };
            all.push(("decoder_head", dim, decoded.head));
            all.push(("decoder_log_std", std_width, decoded.log_std));
            all.push(("prior_mean", skills.prior.latent(), mean));
        }
        Ok(all)
    }
}

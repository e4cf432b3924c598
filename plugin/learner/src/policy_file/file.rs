//! A policy that a game ships with: one self-describing file.

use super::PolicyCard;
use super::examples::Examples;
use super::header::{PolicyShape, SkillsShape};
use crate::file::{FileKind, TensorFile};
use crate::norm::put_obs_stats;
use crate::policy::{Policy, StateBatch};
use crate::skill::{SKILL_STATS, SkillSource};
use crate::{DeviceKind, FileError, LearnError, ObsSlice};
use serde::{Deserialize, Serialize};
use std::path::Path;

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
    pub card: PolicyCard,
    /// The policy.
    pub policy: Policy,
    /// Its skills, if it reads any.
    pub skills: Option<SkillSource>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    card: PolicyCard,
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
        if let Some(picture) = &self.card.picture {
            picture.check(policy.observation()).map_err(learner)?;
        }
        let header = Header {
            card: self.card.clone(),
            policy: PolicyShape::of(policy),
            skills: self.skills.as_ref().map(SkillsShape::of).transpose().map_err(learner)?,
            examples: n,
        };
        let states = StateBatch { z, left: &[], obs, n };
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
        if let Some(picture) = &header.card.picture {
            picture.check(spec.obs).map_err(|e| file.learner(e))?;
        }
        let read = Self { card: header.card, policy, skills };
        Examples::check(&read, &mut file, header.examples)?;
        file.finish()?;
        Ok(read)
    }
}

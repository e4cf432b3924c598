//! A policy over skills in one file: the checkpoints of its learners, whole, as bytes.

use super::over_skills::OverSkills;
use super::{SpirlConfig, SpirlLearner};
use crate::file::{FileKind, TensorFile};
use crate::{DeviceKind, FileError, PpoLearner, SacLearner};
use serde::{Deserialize, Serialize};
use std::path::Path;

const FILE: FileKind = FileKind { name: "spirl checkpoint", version: 2 };

/// The description in its header.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    spirl: SpirlConfig,
    is_sac: bool,
    over_skills: usize,
    below: Option<usize>,
}

impl SpirlLearner {
    /// Reads a file that [`Learner::save`](crate::Learner::save) wrote. The learner continues exactly as the saved
    /// one would have.
    ///
    /// # Errors
    /// [`FileError`] describes the problem of the file.
    pub fn load(path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        let mut file = TensorFile::read(path)?;
        let Header { spirl, is_sac, over_skills, below } = file.header(FILE)?;
        spirl.validate().map_err(|error| file.learner(error))?;
        let mut part = |name: &str, len| TensorFile::parse(path, &file.take_bytes(name, &[len])?);
        let over_skills = part("over_skills", over_skills)?;
        let below = below.map(|len| part("below", len)).transpose()?;
        file.finish()?;
        let over_skills = match is_sac {
            true => OverSkills::Sac(SacLearner::stored(over_skills, device)?),
            false => OverSkills::Ppo(PpoLearner::stored(over_skills, device)?),
        };
        let is_whole = over_skills.learner().base().prior_origin().is_some();
        if !is_whole || below.is_some() != spirl.learn_decoder {
            let detail = "its learners are not those of its description".to_owned();
            return Err(FileError::Format { path: path.to_owned(), detail });
        }
        let below = below.map(|file| PpoLearner::stored(file, device)).transpose()?;
        Ok(Self { config: spirl, over_skills, below })
    }

    /// Returns the file that [`Learner::save`](crate::Learner::save) writes.
    pub(super) fn checkpoint(&self, path: &Path) -> Result<TensorFile, FileError> {
        let over_skills = self.over_skills.checkpoint(path)?.to_bytes()?;
        let below = self.below.as_ref().map(|below| below.checkpoint(path)?.to_bytes()).transpose()?;
        let header = Header {
            spirl: self.config.clone(),
            is_sac: matches!(self.over_skills, OverSkills::Sac(_)),
            over_skills: over_skills.len(),
            below: below.as_ref().map(Vec::len),
        };
        let mut file = TensorFile::new(path, FILE, &header)?;
        file.put_bytes("over_skills", &[over_skills.len()], &over_skills);
        if let Some(below) = &below {
            file.put_bytes("below", &[below.len()], below);
        }
        Ok(file)
    }
}

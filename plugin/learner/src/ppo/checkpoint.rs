//! A learner's complete state in one file.

use super::{PpoConfig, PpoLearner};
use crate::file::TensorFile;
use crate::layout::{check_actor, check_cnn, check_mlp, joined_width};
use crate::nn::tracked;
use crate::norm::{put_normalizers, take_normalizers};
use crate::score::{FrozenSkill, ScoreConfig};
use crate::skill::SkillDescription;
use crate::{DeviceKind, FileError, ObsKind, PolicySpec};
use serde::{Deserialize, Serialize};
use std::path::Path;

const KIND: &str = "ppo checkpoint";
const VERSION: u32 = 1;

/// The JSON in the file's header.
///
/// The learner's generators are streams of `seed` numbered by `updates`, so these two are their whole state.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    kind: String,
    version: u32,
    config: PpoConfig,
    spec: PolicySpec,
    score: Option<ScoreConfig>,
    skill: Option<SkillDescription>,
    seed: u64,
    updates: u64,
    adam_steps: u64,
}

impl PpoLearner {
    /// Writes everything that is needed to go on bit for bit: weights (`actor.l0.weight`, `[inputs, outputs]`), moments
    /// (`adam.m.actor.l0.weight`), normalisers, counters, and the frozen decoder and prior. Under a temporary name
    /// first, so that a checkpoint is whole or not there.
    ///
    /// # Errors
    /// [`FileError::Io`] if it cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let header = Header {
            kind: KIND.to_owned(),
            version: VERSION,
            config: self.config.clone(),
            spec: self.spec,
            score: self.skill.as_ref().map(|skill| skill.config.clone()),
            skill: self.skill.as_ref().map(|skill| skill.description.clone()),
            seed: self.streams.seed(),
            updates: self.updates,
            adam_steps: self.adam.steps,
        };
        let mut file = TensorFile::new(path, &header)?;
        file.put_network("", &self.nets)?;
        if let Some(skill) = &self.skill {
            skill.put(&mut file)?;
        }
        file.put_adam(&self.adam);
        put_normalizers(&mut file, self.observations.as_ref(), self.rewards.as_ref());
        file.write()
    }

    /// Reads a file that [`Self::save`] wrote. The learner goes on exactly as the saved one would have.
    ///
    /// # Errors
    /// [`FileError`] says what is wrong with the file, or names the tensor that is missing, superfluous or misshapen.
    pub fn load(path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        let mut file = TensorFile::read(path)?;
        let header: Header = file.description(KIND, VERSION)?;
        let skill = FrozenSkill::described(header.score, header.skill, header.spec, &file, device)?;
        let copied = skill.as_ref().filter(|skill| skill.is_copied());
        let features = match header.spec.obs {
            ObsKind::Vector(width) => width,
            ObsKind::Image(image) => {
                let cnn = copied.map_or(&header.config.cnn, |skill| &skill.description.config.cnn);
                check_cnn(&file, "actor.cnn", cnn, image)?;
                cnn.features()
            }
        };
        let shape = header.spec.net_shape(features, &header.config.hidden, header.config.activation);
        check_mlp(&file, "critic", (joined_width(&file, "critic", &shape)?, &shape.hidden, 1))?;
        if copied.is_none() {
            check_actor(&file, "actor", &shape, header.spec.action_space, false)?;
        }
        let mut learner =
            Self::build(header.config, header.spec, skill, header.seed, device).map_err(|e| file.learner(e))?;
        file.take_network("", &mut learner.nets, &device.plain())?;
        learner.nets = tracked(&learner.nets);
        if let Some(skill) = &mut learner.skill {
            skill.take(&mut file, device)?;
        }
        take_normalizers(&mut file, learner.observations.as_mut(), learner.rewards.as_mut())?;
        learner.updates = header.updates;
        file.take_adam(&mut learner.adam, "", &mut learner.nets, header.adam_steps)?;
        file.finish()?;
        Ok(learner)
    }
}

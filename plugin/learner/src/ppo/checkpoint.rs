//! A learner's complete state in one file.

use super::frozen::FrozenSkill;
use super::{PolicySpec, PpoConfig, PpoLearner};
use crate::file::TensorFile;
use crate::nn::tracked;
use crate::norm::RunningStats;
use crate::score::ScoreConfig;
use crate::skill::SkillDescription;
use crate::{DeviceKind, FileError};
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
            file.put_network("decoder", &skill.decoder)?;
            file.put_network("prior", &skill.prior)?;
        }
        file.put_adam(&self.adam);
        if let Some(normalizer) = &self.observations {
            put_stats(&mut file, "obs_norm", &normalizer.stats);
        }
        if let Some(normalizer) = &self.rewards {
            put_stats(&mut file, "reward_norm", &normalizer.stats);
            file.put_f64("reward_norm.returns", &normalizer.returns);
        }
        file.write()
    }

    /// Reads a file that [`Self::save`] wrote. The learner goes on exactly as the saved one would have.
    ///
    /// # Errors
    /// [`FileError`] says what is wrong with the file, or names the tensor that is missing, superfluous or misshapen.
    pub fn load(path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        let mut file = TensorFile::read(path)?;
        let header: Header = file.description(KIND, VERSION)?;
        let skill = match (header.score, header.skill) {
            (Some(config), Some(description)) => {
                let nets = description.nets(device).map_err(|e| file.learner(e))?;
                Some(FrozenSkill { config, description, decoder: nets.decoder, prior: nets.prior })
            }
            _ => None,
        };
        let mut learner =
            Self::build(header.config, header.spec, skill, header.seed, device).map_err(|e| file.learner(e))?;
        let plain = device.plain();
        file.take_network("", &mut learner.nets, &plain)?;
        learner.nets = tracked(&learner.nets);
        if let Some(skill) = &mut learner.skill {
            file.take_network("decoder", &mut skill.decoder, &plain)?;
            file.take_network("prior", &mut skill.prior, &plain)?;
        }
        if let Some(normalizer) = &mut learner.observations {
            take_stats(&mut file, "obs_norm", &mut normalizer.stats)?;
        }
        if let Some(normalizer) = &mut learner.rewards {
            take_stats(&mut file, "reward_norm", &mut normalizer.stats)?;
            normalizer.returns = file.take_f64("reward_norm.returns", None)?;
        }
        learner.updates = header.updates;
        file.take_adam(&mut learner.adam, &mut learner.nets, header.adam_steps)?;
        file.finish()?;
        Ok(learner)
    }
}

fn put_stats(file: &mut TensorFile, name: &str, stats: &RunningStats) {
    file.put_f64(&format!("{name}.mean"), &stats.mean);
    file.put_f64(&format!("{name}.var"), &stats.var);
    file.put_f64(&format!("{name}.count"), &[stats.count]);
}

fn take_stats(file: &mut TensorFile, name: &str, stats: &mut RunningStats) -> Result<(), FileError> {
    let dim = stats.dim();
    stats.mean = file.take_f64(&format!("{name}.mean"), Some(dim))?;
    stats.var = file.take_f64(&format!("{name}.var"), Some(dim))?;
    stats.count = file.take_f64(&format!("{name}.count"), Some(1))?[0];
    Ok(())
}

//! A trainer's complete state in one file.

use super::held_out::Best;
use super::state_heads::told_numbers;
use super::{Dataset, SkillDescription, SkillNets, SkillTrainer, StateHeads};
use crate::file::{FileKind, TensorFile};
use crate::norm::{put_obs_stats, take_obs_stats};
use crate::{DeviceKind, FileError, LearnError};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

const FILE: FileKind = FileKind { name: "skill checkpoint", version: 1 };

/// The JSON in the file's header.
///
/// The trainer's generators are streams of `seed` numbered by the epoch and by `adam_steps`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    skill: SkillDescription,
    seed: u64,
    epoch: u64,
    windows_done: usize,
    adam_steps: u64,
    batches: usize,
    demo_episodes: usize,
    demo_steps: usize,
    /// A hash of the demonstrations; the first checkpoints had none.
    #[serde(default)]
    demo_hash: Option<u64>,
    /// The best epoch on the held-out demonstrations, and the NLL there; the first checkpoints had the whole loss.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    best: Option<(u64, f32)>,
}

impl SkillTrainer {
    /// Writes the complete state except the demonstrations, so that training continues bit for bit. The file gets a
    /// temporary name first, so a checkpoint is complete or absent.
    ///
    /// # Errors
    /// [`FileError::Io`] if it cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let header = Header {
            skill: self.description(),
            seed: self.streams.seed(),
            epoch: self.epoch,
            windows_done: self.next,
            adam_steps: self.adam.steps,
            batches: self.sums.count,
            demo_episodes: self.extent.0,
            demo_steps: self.extent.1,
            demo_hash: Some(self.fingerprint),
            best: self.best.as_ref().map(|best| (best.epoch, best.nll)),
        };
        let mut file = TensorFile::new(path, FILE, &header)?;
        file.put_network("", &self.nets)?;
        file.put_adam(&self.adam)?;
        if let Some(stats) = &self.stats {
            put_obs_stats(&mut file, "obs_norm", stats);
        }
        if let Some(best) = &self.best {
            file.put_network("best", &best.nets)?;
        }
        file.put_f64("epoch_sums", &self.sums.total);
        file.write()
    }

    /// Reads a file that [`Self::save`] wrote; `dataset` must be the one of that run.
    ///
    /// # Errors
    /// [`FileError`] describes the problem of the file, or does not fit the demonstrations.
    pub fn load(path: &Path, dataset: Dataset, device: DeviceKind) -> Result<Self, FileError> {
        let mut file = TensorFile::read(path)?;
        let header: Header = file.header(FILE)?;
        device.check().map_err(|e| file.learner(e))?;
        let skill = header.skill;
        for (what, expected, found) in [
            ("episodes of the demonstrations", header.demo_episodes, dataset.episodes()),
            ("steps of the demonstrations", header.demo_steps, dataset.steps()),
        ] {
            LearnError::check(what, expected, found).map_err(|e| file.learner(e))?;
        }
        if skill.observation != dataset.observation() {
            let (reads, found) = (skill.observation, dataset.observation());
            return Err(file.format(format!("reads {reads}, the demonstrations are {found}")));
        }
        if skill.action_space != dataset.action_space() {
            return Err(file.format(format!(
                "acts with {}, the demonstrations with {}",
                skill.action_space,
                dataset.action_space()
            )));
        }
        let mut nets = SkillNets::stored(&skill, &mut file, "", &device.plain())?;
        if let Some(numbers) = told_numbers(&skill.config, &dataset) {
            let features = skill.config.cnn.features();
            let heads = StateHeads::build(&mut file.params(&device.plain()), "state_heads", features, numbers)?;
            nets.state_heads = Some(heads);
        }
        let best = match header.best {
            None => None,
            Some((epoch, nll)) => {
                let nets = SkillNets::stored(&skill, &mut file, "best", &device.plain())?;
                Some(Best { epoch, nll, nets })
            }
        };
        let trainer = Self::with_nets(skill.config, dataset, &nets, header.seed, device);
        let mut trainer = trainer.map_err(|e| file.learner(e))?;
        if header.demo_hash.is_some_and(|hash| hash != trainer.fingerprint) {
            let text = "the demonstrations are not those of this run: their episodes differ in content";
            return Err(file.format(text.to_owned()));
        }
        file.take_adam(&mut trainer.adam, "", &mut trainer.nets, header.adam_steps)?;
        if let Some(stats) = &mut trainer.stats {
            *stats = Arc::new(take_obs_stats(&mut file, "obs_norm", trainer.dataset.obs_dim())?);
        }
        trainer.sums.count = header.batches;
        // Older checkpoints have no error of states.
        let sums = file.take_f64("epoch_sums", None)?;
        trainer.sums.total.iter_mut().zip(sums).for_each(|(total, sum)| *total = sum);
        trainer.best = best;
        trainer.epoch = header.epoch;
        let windows = trainer.cut_windows(header.epoch);
        trainer.windows = windows.map_err(|e| file.learner(e))?;
        if header.windows_done >= trainer.windows.len() {
            return Err(file.format("is behind the end of its epoch".to_owned()));
        }
        trainer.next = header.windows_done;
        file.finish()?;
        Ok(trainer)
    }
}

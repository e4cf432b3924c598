//! A learner's complete state in one file: the frame that all learners share.

use super::LearnerBase;
use crate::device::guarded;
use crate::file::{FileKind, TensorFile};
use crate::norm::{put_normalizers, take_normalizers};
use crate::score::{ScoreConfig, Teacher, TiedTo};
use crate::skill::SkillDescription;
use crate::{DeviceKind, FileError, PolicySpec};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The JSON in the header of every learner's checkpoint: the settings `C`, the common state, and the counters `K` of
/// the algorithm.
///
/// A learner's generators are streams of `seed` numbered by its counters, so these are their whole state.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header<C, K> {
    config: C,
    spec: PolicySpec,
    score: Option<ScoreConfig>,
    skill: Option<SkillDescription>,
    #[serde(default, skip_serializing_if = "TiedTo::is_decoder")]
    tied_to: TiedTo,
    seed: u64,
    updates: u64,
    #[serde(flatten)]
    counters: K,
}

impl LearnerBase {
    /// Writes a checkpoint of this `kind`: settings, counters, the algorithm's own tensors from `put` (networks,
    /// moments, ...), the frozen decoder and prior, and the normalisers.
    ///
    /// # Errors
    /// [`FileError::Learner`] if a device does not return its numbers.
    pub(crate) fn checkpoint(
        &self,
        path: &Path,
        kind: FileKind,
        config: &impl Serialize,
        counters: &impl Serialize,
        put: impl FnOnce(&mut TensorFile) -> Result<(), FileError>,
    ) -> Result<TensorFile, FileError> {
        let teacher = self.teacher.as_ref();
        let header = Header {
            config,
            spec: self.spec,
            score: teacher.map(|teacher| teacher.config.clone()),
            skill: teacher.map(|teacher| teacher.description.clone()),
            tied_to: teacher.map(|teacher| teacher.tied_to).unwrap_or_default(),
            seed: self.streams.seed(),
            updates: self.updates,
            counters,
        };
        let mut file = TensorFile::new(path, kind, &header)?;
        let put = guarded(&self.device.plain(), || Ok(put(&mut file)));
        put.map_err(|error| FileError::Learner { path: path.to_owned(), source: error })??;
        if let Some(teacher) = teacher {
            teacher.put(&mut file)?;
        }
        put_normalizers(&mut file, self.observations.as_ref(), self.rewards.as_ref());
        Ok(file)
    }
}

/// A checkpoint that was read, with the tensors that were not taken out yet.
#[derive(Debug)]
pub(crate) struct Checkpoint<C, K> {
    pub(crate) file: TensorFile,
    pub(crate) config: C,
    pub(crate) counters: K,
    pub(crate) spec: PolicySpec,
    pub(crate) teacher: Option<Teacher>,
    pub(crate) seed: u64,
    updates: u64,
}

impl<C: DeserializeOwned, K: DeserializeOwned> Checkpoint<C, K> {
    /// Reads a checkpoint of this `kind` from `file`, and takes the frozen decoder and prior out of it.
    ///
    /// # Errors
    /// [`FileError`] describes the problem of the file, or names the tensor that is missing or misshapen.
    pub(crate) fn of(mut file: TensorFile, kind: FileKind, device: DeviceKind) -> Result<Self, FileError> {
        device.check().map_err(|e| file.learner(e))?;
        let Header { config, spec, score, skill, tied_to, seed, updates, counters }: Header<C, K> =
            file.header(kind)?;
        let teacher = match score.zip(skill) {
            None => None,
            Some((score, skill)) => Some(Teacher::take((score, tied_to), skill, spec, &mut file, device)?),
        };
        Ok(Self { file, config, counters, spec, teacher, seed, updates })
    }

    /// Restores the common state of a learner that has taken out everything else.
    ///
    /// # Errors
    /// [`FileError`] names a tensor that is missing, misshapen or superfluous.
    pub(crate) fn finish(mut self, base: &mut LearnerBase) -> Result<(), FileError> {
        take_normalizers(&mut self.file, base.observations.as_mut(), base.rewards.as_mut())?;
        base.updates = self.updates;
        self.file.finish()
    }
}

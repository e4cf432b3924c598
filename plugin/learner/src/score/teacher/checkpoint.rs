//! The teacher in a learner's checkpoint.

use super::{Teacher, TiedTo};
use crate::file::TensorFile;
use crate::norm::put_obs_stats;
use crate::score::ScoreConfig;
use crate::skill::{Actors, SKILL_STATS, SkillDescription};
use crate::{DeviceKind, FileError, PolicySpec};

impl Teacher {
    /// Adds the weights of decoder and prior to a file, and their normaliser.
    pub(crate) fn put(&self, file: &mut TensorFile) -> Result<(), FileError> {
        if let Some(stats) = &self.stats {
            put_obs_stats(file, SKILL_STATS, stats);
        }
        file.put_network("decoder", &self.actors.decoder)?;
        file.put_network("prior", &self.actors.prior)
    }

    /// Takes the teacher that [`Self::put`] has added out of `file`, the checkpoint of a policy of `spec`.
    pub(crate) fn take(
        (config, tied_to): (ScoreConfig, TiedTo),
        description: SkillDescription,
        spec: PolicySpec,
        file: &mut TensorFile,
        device: DeviceKind,
    ) -> Result<Self, FileError> {
        let actors = Actors::stored(&description, file, "", &device.plain())?;
        let mut teacher = Self { config, tied_to, description, actors, stats: None };
        let tied = teacher.policy_spec();
        if tied != spec {
            return Err(file.format(format!("the policy is {spec:?}, but its skill model makes it {tied:?}")));
        }
        teacher.stats = teacher.description.take_stats(file, SKILL_STATS)?;
        Ok(teacher)
    }
}

//! The PPO learner, which is SCORE-PPO if it is given a skill model.

use super::{PpoConfig, PpoNets};
use crate::device::guarded;
use crate::file::{FileKind, TensorFile};
use crate::learner::{Checkpoint, Learner, LearnerBase, LearnerMetrics};
use crate::nn::{Adam, AdamConfig, tracked};
use crate::policy::{Policy, StateBatch};
use crate::score::{ScoreConfig, Teacher, TiedTo};
use crate::skill::SkillModel;
use crate::{DeviceKind, FileError, LearnError, ObsKind, ObsSlice, PolicySpec, Rollout};
use serde::{Deserialize, Serialize};
use std::path::Path;

const FILE: FileKind = FileKind { name: "ppo checkpoint", version: 1 };

/// Improves a policy from rollouts.
///
/// Without a skill model this is PPO; with one it is SCORE-PPO (see [`crate::score`]). The numbers depend only on the
/// settings, the seed and the rollouts.
#[derive(Debug)]
pub struct PpoLearner {
    pub(super) config: PpoConfig,
    pub(crate) base: LearnerBase,
    pub(crate) nets: PpoNets,
    pub(super) adam: Adam,
}

/// The counters in a checkpoint.
#[derive(Serialize, Deserialize, Debug)]
struct Counters {
    adam_steps: u64,
}

impl PpoLearner {
    /// Creates plain PPO with starting weights from `seed`.
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings.
    pub fn new(config: PpoConfig, spec: PolicySpec, seed: u64, device: DeviceKind) -> Result<Self, LearnError> {
        Self::fresh(config, spec, None, seed, device)
    }

    /// Creates SCORE-PPO: tied to `model`'s decoder by the settings of `score`.
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings.
    pub fn with_skill(
        config: PpoConfig,
        score: ScoreConfig,
        model: &SkillModel,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        let teacher = Teacher::new(score, TiedTo::Decoder, model, device)?;
        Self::fresh(config, teacher.policy_spec(), Some(teacher), seed, device)
    }

    /// Creates PPO with starting weights, tied to `teacher` if there is one.
    pub(crate) fn fresh(
        config: PpoConfig,
        spec: PolicySpec,
        teacher: Option<Teacher>,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        let base = Self::new_base(&config, spec, teacher, seed, device)?;
        let nets = guarded(&base.device.plain(), || PpoNets::fresh(&config, &base))?;
        Ok(Self::with_nets(config, base, &nets))
    }

    fn new_base(
        config: &PpoConfig,
        spec: PolicySpec,
        teacher: Option<Teacher>,
        seed: u64,
        device: DeviceKind,
    ) -> Result<LearnerBase, LearnError> {
        config.validate()?;
        if config.norm_obs && matches!(spec.obs, ObsKind::Image(_)) {
            let text = "ppo norm_obs is for vectors: the pixels of images are divided by 255 instead";
            return Err(LearnError::Config(text.to_owned()));
        }
        config.check_observation(&spec.obs)?;
        let rewards = config.norm_reward.then(|| config.reward_normalizer());
        LearnerBase::new(spec, teacher, rewards, config.norm_obs, seed, device)
    }

    fn with_nets(config: PpoConfig, base: LearnerBase, nets: &PpoNets) -> Self {
        let PpoConfig { adam_eps: eps, weight_decay, .. } = config;
        let adam = Adam::new(AdamConfig { eps, weight_decay, ..AdamConfig::default() });
        Self { config, base, nets: tracked(nets), adam }
    }

    /// Returns the settings.
    pub fn config(&self) -> &PpoConfig {
        &self.config
    }

    /// Reads a file that [`Learner::save`] wrote. The learner continues exactly as the saved one would have.
    ///
    /// # Errors
    /// [`FileError`] describes the problem of the file, or names the tensor that is missing, superfluous or
    /// misshapen.
    pub fn load(path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        Self::stored(TensorFile::read(path)?, device)
    }

    /// Reads a file in memory as [`Self::load`] does.
    pub(crate) fn stored(file: TensorFile, device: DeviceKind) -> Result<Self, FileError> {
        let mut saved = Checkpoint::<PpoConfig, Counters>::of(file, FILE, device)?;
        let base = Self::new_base(&saved.config, saved.spec, saved.teacher.take(), saved.seed, device);
        let base = base.map_err(|e| saved.file.learner(e))?;
        let nets = PpoNets::stored(&saved.config, &base, &mut saved.file)?;
        let mut learner = Self::with_nets(saved.config.clone(), base, &nets);
        saved.file.take_adam(&mut learner.adam, "", &mut learner.nets, saved.counters.adam_steps)?;
        saved.finish(&mut learner.base)?;
        Ok(learner)
    }

    /// Returns the file that [`Learner::save`] writes.
    pub(crate) fn checkpoint(&self, path: &Path) -> Result<TensorFile, FileError> {
        let counters = Counters { adam_steps: self.adam.steps };
        self.base.checkpoint(path, FILE, &self.config, &counters, |file| {
            file.put_network("", &self.nets)?;
            file.put_adam(&self.adam)?;
            Ok(())
        })
    }
}

impl Learner for PpoLearner {
    fn base(&self) -> &LearnerBase {
        &self.base
    }

    /// Returns the policy that plays, with its critic.
    fn policy(&self) -> Policy {
        self.base.snapshot(&self.nets.actor, Some(&self.nets.critic))
    }

    fn learn(&mut self, rollout: &Rollout) -> Result<LearnerMetrics, LearnError> {
        Ok(LearnerMetrics::new(self.update(rollout)?.scalars()))
    }

    fn initial_kl(&self, z: &[f32], obs: ObsSlice<'_>, n: usize) -> Result<Option<f32>, LearnError> {
        self.base.initial_kl(&self.policy(), self.base.updates == 0, StateBatch { z, left: &[], obs, n })
    }

    /// Saves the learner. Weights are called `actor.l0.weight` (`[inputs, outputs]`), moments
    /// `adam.m.actor.l0.weight`.
    fn save(&self, path: &Path) -> Result<(), FileError> {
        self.checkpoint(path)?.write()
    }

    fn set_total_updates(&mut self, total: Option<u64>) {
        self.config.total_updates = total;
    }
}

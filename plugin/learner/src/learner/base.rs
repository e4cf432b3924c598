//! The common part of all learners, besides networks and optimizers.

use crate::norm::{ObsNormalizer, ObsStats, RewardNormalizer};
use crate::policy::{Actor, Critic, Policy, StateBatch};
use crate::rng::Streams;
use crate::score::{ScoreConfig, Teacher};
use crate::{DeviceKind, LearnError, PolicySpec};
use std::sync::Arc;
use std::time::Duration;

/// The common part of all learners: the policy's inputs and outputs, the skill model that it is tied to, normalisers,
/// random numbers, and the device.
#[derive(Debug)]
pub struct LearnerBase {
    pub(crate) spec: PolicySpec,
    /// The frozen skill model; `None` without SCORE.
    pub(crate) teacher: Option<Teacher>,
    pub(crate) rewards: Option<RewardNormalizer>,
    pub(crate) observations: Option<ObsNormalizer>,
    pub(crate) streams: Streams,
    /// Number of rollouts learned from.
    pub(crate) updates: u64,
    pub(crate) device: DeviceKind,
    /// Time spent assembling minibatches since this learner was made.
    pub(crate) gathering: Duration,
}

impl LearnerBase {
    /// Creates a learner's base before its first update; `norm_obs`: the learner normalises observations itself.
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings.
    pub(crate) fn new(
        spec: PolicySpec,
        teacher: Option<Teacher>,
        rewards: Option<RewardNormalizer>,
        norm_obs: bool,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        device.check()?;
        spec.validate()?;
        if let Some(teacher) = &teacher {
            teacher.check(norm_obs)?;
        }
        let observations = norm_obs.then(|| ObsNormalizer::new(spec.obs.numbers()));
        Ok(Self {
            spec,
            teacher,
            rewards,
            observations,
            streams: Streams::new(seed),
            updates: 0,
            device,
            gathering: Duration::ZERO,
        })
    }

    /// Returns the settings of SCORE, with a skill model.
    pub(crate) fn score_config(&self) -> Option<&ScoreConfig> {
        self.teacher.as_ref().map(|teacher| &teacher.config)
    }

    /// Returns the skill model, if the policy starts as a copy of its decoder.
    pub(crate) fn copied_teacher(&self) -> Option<&Teacher> {
        self.teacher.as_ref().filter(|teacher| teacher.is_copied())
    }

    /// Returns the prior, for a policy over skills that starts as it.
    pub(crate) fn prior_origin(&self) -> Option<&Actor> {
        self.teacher.as_ref().filter(|teacher| !teacher.tied_to.is_decoder()).map(Teacher::origin)
    }

    /// Returns the width of the skills that a rollout must hold.
    pub(crate) fn rollout_latent(&self) -> usize {
        self.teacher.as_ref().map_or(self.spec.latent, Teacher::rollout_latent)
    }

    /// Returns the present normalisation of the networks' observations: the frozen normaliser of the skill model if
    /// that has one, else the learner's own running one, else `None`.
    pub(crate) fn obs_stats(&self) -> Option<Arc<ObsStats>> {
        let frozen = self.teacher.as_ref().and_then(|teacher| teacher.stats.clone());
        frozen.or_else(|| self.observations.as_ref().map(|normalizer| Arc::new(normalizer.snapshot())))
    }

    /// Returns a snapshot of networks with the present normalisation of observations.
    pub(crate) fn snapshot(&self, actor: &Actor, critic: Option<&Critic>) -> Policy {
        Policy::new(actor, critic, self.obs_stats(), self.spec, self.device.plain())
    }

    /// Returns the mean divergence between decoder and `policy`, as
    /// [`Learner::initial_kl`](super::Learner::initial_kl) does.
    pub(crate) fn initial_kl(
        &self,
        policy: &Policy,
        untrained: bool,
        states: StateBatch<'_>,
    ) -> Result<Option<f32>, LearnError> {
        let Some(teacher) = &self.teacher else { return Ok(None) };
        teacher.initial_kl(policy, untrained, states, self.device).map(Some)
    }
}

//! One update from top to bottom: rollout → advantages → minibatches → loss → step. Its formulas are in
//! `objective.rs`.

use super::batch::{Batch, JoinedRows, minibatches};
use super::metrics::Has;
use super::objective::gae;
use super::on_device::{Reports, SentRollout};
use super::step::{Moment, step_in_parts};
use super::{PpoConfig, PpoLearner, StepMetrics, UpdateMetrics, explained_variance};
use crate::device::{is_host, update_on};
use crate::nn::{Adam, AdamConfig};
use crate::policy::StateBatch;
use crate::rng::ChaCha8Rng;
use crate::score::TeacherOutput;
use crate::{LearnError, Observations, Rollout};
use std::cell::Cell;
use std::time::Instant;

impl PpoLearner {
    /// Trains on a rollout: epochs × minibatches gradient steps.
    ///
    /// # Errors
    /// [`LearnError::Shape`], [`LearnError::Action`] or [`LearnError::Config`] if the rollout does not fit, and
    /// [`LearnError::Input`] if it holds numbers that are not finite, before anything is changed.
    /// [`LearnError::NotFinite`] and [`LearnError::Exploded`] name the number that diverged; the learner is unusable
    /// then, as after [`LearnError::DeviceFailed`].
    pub fn update(&mut self, rollout: &Rollout) -> Result<UpdateMetrics, LearnError> {
        update_on(&self.base.device.plain(), || self.update_here(rollout))
    }

    fn update_here(&mut self, rollout: &Rollout) -> Result<UpdateMetrics, LearnError> {
        rollout.check_for(&self.base.spec, self.base.rollout_latent())?;
        let rewards = match &mut self.base.rewards {
            Some(normalizer) => normalizer.normalize(&rollout.rewards, &rollout.done(), rollout.envs)?,
            None => rollout.rewards.clone(),
        };
        let config = &self.config;
        let estimate = gae(rollout, &rewards, config.gamma, config.lambda, config.time_limit);
        let explained_variance = explained_variance(&rollout.values, &estimate.returns);
        let latent = self.base.spec.latent;
        let teacher = self.teacher_output(rollout)?;
        let start = Instant::now();
        let joined = JoinedRows::of(rollout, latent, self.base.obs_stats().as_deref());
        let batch = Batch {
            rollout,
            advantages: estimate.advantages,
            returns: estimate.returns,
            teacher,
            latent,
            joined,
            norm_adv: config.norm_adv,
            augment: (config.augment.clone(), self.base.streams.stream("ppo.augment", self.base.updates).into()),
            gathering: Cell::new(start.elapsed()),
        };
        let lr = config.lr_at(self.base.updates);
        let score = self.base.score_config().map(|score| score.at(self.base.updates, config.total_updates));
        let is_warming_up = self.base.updates < config.critic_warmup;
        self.prepare_adam(is_warming_up);
        let moment = Moment { lr, score: score.as_ref(), is_warming_up };
        let mut rng = self.base.streams.stream("ppo.minibatches", self.base.updates);
        let sum = if is_host(&self.base.device.plain()) {
            self.steps(&batch, &mut rng, &moment)?
        } else {
            self.steps_on_device(&batch, &mut rng, &moment)?
        };
        self.base.updates += 1;
        self.base.gathering += batch.gathering.get();
        if let (Some(normalizer), Observations::Vector(values)) = (&mut self.base.observations, &rollout.obs) {
            normalizer.update(values);
        }
        let steps = self.config.epochs * self.config.minibatches.min(rollout.rows());
        let has = Has { penalty: batch.teacher.is_some(), augmentation: !self.config.augment.is_empty() };
        Ok(UpdateMetrics::mean(&sum, steps, has, explained_variance, lr))
    }

    /// Restarts Adam when the policy begins to learn. While the critic warms up the policy's gradients are zero: the
    /// moments stay 0 while their bias correction wears off, so its first steps would be several times too long.
    /// Before that there is no weight decay, either.
    fn prepare_adam(&mut self, is_warming_up: bool) {
        let PpoConfig { critic_warmup, weight_decay, .. } = self.config;
        let config = AdamConfig { weight_decay: if is_warming_up { 0.0 } else { weight_decay }, ..self.adam.config };
        if critic_warmup > 0 && self.base.updates == critic_warmup {
            self.adam = Adam::new(config);
        }
        self.adam.config = config;
    }

    fn steps(
        &mut self,
        batch: &Batch<'_>,
        rng: &mut ChaCha8Rng,
        moment: &Moment<'_>,
    ) -> Result<StepMetrics, LearnError> {
        let device = self.base.device.plain();
        let mut sum = StepMetrics::default();
        for rows in minibatches(&self.config, batch.rollout.rows(), rng) {
            let parts = batch.parts(&rows, self.nets.actor.cnn.as_ref(), moment.score, &device);
            let step = step_in_parts(&mut self.nets, &mut self.adam, parts, &self.config, moment)?;
            sum.add(&step, 1.0);
        }
        Ok(sum)
    }

    fn steps_on_device(
        &mut self,
        batch: &Batch<'_>,
        rng: &mut ChaCha8Rng,
        moment: &Moment<'_>,
    ) -> Result<StepMetrics, LearnError> {
        let start = Instant::now();
        let sent = SentRollout::send(batch, &self.base.device.plain());
        batch.gathered(start);
        let (mut reports, before) = (Reports::default(), self.adam.steps());
        for rows in minibatches(&self.config, batch.rollout.rows(), rng) {
            let minibatch = sent.minibatch(&rows);
            reports.step(&mut self.nets, &mut self.adam, &minibatch, &self.config, moment)?;
        }
        reports.sum(before)
    }

    /// Returns the decoder's outputs for the whole rollout: it is frozen, so once per update is enough.
    fn teacher_output(&self, rollout: &Rollout) -> Result<Option<TeacherOutput>, LearnError> {
        let Some(teacher) = &self.base.teacher else { return Ok(None) };
        let mut rng = self.base.streams.stream("score.own_samples", self.base.updates);
        let states = StateBatch { z: &rollout.z, left: &[], obs: rollout.obs.as_slice(), n: rollout.rows() };
        teacher.output(states, &rollout.actions, false, &mut rng, self.base.device)
    }
}

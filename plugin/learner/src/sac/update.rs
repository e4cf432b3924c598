//! One update from top to bottom: rollout → replay buffer → batches → steps of critics, actor and temperature → targets.
//! The losses and their steps are in `loss.rs` and `steps.rs`.

use super::buffer::ReplayBuffer;
use super::metrics::MetricSums;
use super::transitions::check_ends;
use super::{
    EntropyCoef, SacBatch, SacConfig, SacLearner, SacMetrics, actor_step, critic_step, soft_update, temperature_step,
};
use crate::device::update_on;
use crate::nn::matrix;
use crate::rng::{ChaCha8Rng, normal, shuffle};
use crate::{ActionSpace, LearnError, Rollout};
use burn::tensor::Tensor;
use std::time::Instant;

impl SacLearner {
    /// Adds a rollout (with its [`Rollout::ends`]; log-probabilities and values are not read) and, once there are
    /// [`SacConfig::learning_starts`](super::SacConfig::learning_starts) transitions, does the gradient steps that
    /// are due.
    ///
    /// # Errors
    /// [`LearnError::Shape`], [`LearnError::Action`] or [`LearnError::Config`] if the rollout does not fit, and
    /// [`LearnError::Input`] if it holds numbers that are not finite, before anything is changed.
    /// [`LearnError::NotFinite`] and [`LearnError::Exploded`] name the number that diverged; the learner is unusable
    /// then.
    pub fn update(&mut self, rollout: &Rollout) -> Result<SacMetrics, LearnError> {
        update_on(&self.base.device.plain(), || {
            self.check_rollout(rollout)?;
            if let Some(normalizer) = &mut self.base.rewards {
                normalizer.update(&rollout.rewards, &rollout.done(), rollout.envs)?;
            }
            self.update_here(rollout, &[])
        })
    }

    /// Does [`Self::update`] for a policy over skills. The scale of its rewards is known already: they were added
    /// tick by tick. `weights` scales the next state's value of each row, beside the discount.
    pub(crate) fn update_of_skills(&mut self, rollout: &Rollout, weights: &[f32]) -> Result<SacMetrics, LearnError> {
        update_on(&self.base.device.plain(), || {
            self.check_rollout(rollout)?;
            self.update_here(rollout, weights)
        })
    }

    fn check_rollout(&self, rollout: &Rollout) -> Result<(), LearnError> {
        rollout.check_for(&self.base.spec, self.base.rollout_latent())?;
        check_ends(rollout)?;
        self.buffer.check_clock(rollout)
    }

    fn update_here(&mut self, rollout: &Rollout, weights: &[f32]) -> Result<SacMetrics, LearnError> {
        let base = &mut self.base;
        if let Some(normalizer) = &mut base.observations {
            normalizer.update(rollout.obs.as_slice().vectors("SAC")?);
        }
        self.buffer.push(rollout, weights)?;
        let mut sums = MetricSums::default();
        let due = self.steps_due(rollout.rows());
        for _ in 0..due {
            self.gradient_step(&mut sums)?;
        }
        self.base.updates += 1;
        let penalised = self.base.prior_origin().is_some() || self.base.score_config().is_some_and(|score| score.kl);
        let entropy_coef = if due > 0 { Some(self.temperature()? as f32) } else { None };
        let (transitions, gradient_steps) = (self.buffer.seen, self.gradient_steps);
        Ok(SacMetrics { transitions, gradient_steps, entropy_coef, ..sums.means(penalised) })
    }

    /// Returns the whole gradient steps for `rows` new transitions.
    fn steps_due(&mut self, rows: usize) -> u64 {
        if self.buffer.seen < self.config.learning_starts {
            return 0;
        }
        let owed = self.carry + self.config.updates_per_step * rows as f64;
        self.carry = owed.fract();
        owed as u64
    }

    /// Does the critics' step, the actor's and the temperature's where they are due, and the targets'.
    fn gradient_step(&mut self, sums: &mut MetricSums) -> Result<(), LearnError> {
        let number = self.gradient_steps;
        let drawn = self.draw(number)?;
        let seen_by_target = self.critics_of_target(number);
        let mut rng = self.base.streams.stream("sac.noise", number);
        self.gradient_steps += 1;
        let is_warming_up = number < self.config.critic_warmup;
        let with_actor = !is_warming_up && self.gradient_steps.is_multiple_of(self.config.actor_every);
        let start = Instant::now();
        let batch = self.batch(&drawn, seen_by_target, with_actor)?;
        self.base.gathering += start.elapsed();
        let noise = self.noise(&mut rng);
        let (temperature, config) = (self.temperature()?, &self.config);
        let (nets, adam) = (&mut self.nets, &mut self.optimizers.critics);
        sums.add_critics(&critic_step(
            nets,
            adam,
            &batch,
            noise.as_ref(),
            temperature,
            config.gamma,
            config.critic_lr,
        )?);
        if with_actor {
            for _ in 0..self.config.actor_every {
                self.actor_update(&batch, &mut rng, sums)?;
            }
        }
        if self.gradient_steps.is_multiple_of(self.config.target_every) {
            soft_update(&mut self.nets.targets, &self.nets.critics, self.config.tau);
        }
        Ok(())
    }

    /// Returns the transitions of gradient step `number`: from play, and from recordings if there are any.
    pub(super) fn draw(&self, number: u64) -> Result<ReplayBuffer, LearnError> {
        let recorded = self.demos.as_ref().map_or(0, |demos| demos.of_batch(&self.config));
        let mut rng = self.base.streams.stream("sac.batch", number);
        let played = self.buffer.draw(self.config.batch - recorded, &mut rng);
        match &self.demos {
            None => self.buffer.picked(&played, None),
            Some(demos) => {
                let slots = demos.buffer.draw(recorded, &mut rng);
                self.buffer.picked(&played, Some((&demos.buffer, &slots)))
            }
        }
    }

    /// Returns the critics whose least value is the target of gradient step `number`; empty for all.
    fn critics_of_target(&self, number: u64) -> Vec<usize> {
        let SacConfig { critics, target_critics, .. } = self.config;
        if target_critics >= critics {
            return Vec::new();
        }
        let mut all: Vec<usize> = (0..critics).collect();
        shuffle(&mut all, &mut self.base.streams.stream("sac.target_critics", number));
        all.truncate(target_critics);
        all
    }

    /// Does a step of the actor and, if it is tuned, one of the temperature.
    fn actor_update(
        &mut self,
        batch: &SacBatch,
        rng: &mut ChaCha8Rng,
        sums: &mut MetricSums,
    ) -> Result<(), LearnError> {
        let (temperature, noise) = (self.temperature()?, self.noise(rng));
        let (score, lr) = (self.base.score_config(), self.config.actor_lr);
        let (nets, adam) = (&mut self.nets, &mut self.optimizers.actor);
        sums.add_actor(&actor_step(nets, adam, batch, noise.as_ref(), temperature, score, lr)?);
        if let Some(target) = self.config.target_entropy(self.base.spec.action_space) {
            let noise = self.noise(rng);
            let (nets, adam, lr) = (&mut self.nets, &mut self.optimizers.temperature, self.config.temperature_lr);
            sums.add_temperature(&temperature_step(nets, adam, batch, noise.as_ref(), target, lr)?);
        }
        Ok(())
    }

    /// Returns the present weight of entropy.
    pub(crate) fn temperature(&self) -> Result<f64, LearnError> {
        match self.config.entropy {
            EntropyCoef::Auto { .. } => self.nets.temperature(),
            EntropyCoef::Fixed(temperature) => Ok(temperature),
        }
    }

    /// Returns standard normal numbers for a batch of draws; discrete actions need none.
    fn noise(&self, rng: &mut ChaCha8Rng) -> Option<Tensor<2>> {
        let ActionSpace::Continuous(dim) = self.base.spec.action_space else { return None };
        let n = self.config.batch;
        Some(matrix((0..n * dim).map(|_| normal(rng)).collect(), n, dim, &self.base.device.plain()))
    }
}

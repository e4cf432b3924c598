//! One update from top to bottom: rollout → advantages → minibatches → loss → step. Its formulas are in
//! `objective.rs`.

use super::objective::{PpoBatch, gae, normalize_advantages, ppo_loss};
use super::{PpoConfig, PpoLearner, PpoNets, StepMetrics, UpdateMetrics, explained_variance, ratio_stats};
use crate::nn::{ActionBatch, Adam, NamedGrads, finite, host, vector};
use crate::norm::ObsStats;
use crate::policy::{InputBuilder, NetInput, StateBatch};
use crate::rng::shuffle;
use crate::score::{Penalty, ScoreConfig, TeacherBatch, TeacherOutput, penalty};
use crate::{LearnError, Observations, Rollout, among_workers};
use burn::tensor::Device;
use std::sync::Arc;

/// A rollout with everything that an update reads beside it, one entry per row.
#[derive(Debug)]
struct Batch<'a> {
    rollout: &'a Rollout,
    advantages: Vec<f32>,
    returns: Vec<f32>,
    teacher: Option<TeacherOutput>,
    /// How many of the rollout's skill numbers the networks read: all or none.
    latent: usize,
    stats: Option<Arc<ObsStats>>,
    norm_adv: bool,
}

/// One minibatch on the device.
#[derive(Clone, Debug)]
pub struct Minibatch {
    /// What actor and critic read.
    pub inputs: NetInput,
    /// Constants of the PPO loss.
    pub ppo: PpoBatch,
    /// Constants of the penalty, if there is one.
    pub teacher: Option<TeacherBatch>,
}

impl PpoLearner {
    /// Trains on a rollout: epochs × minibatches gradient steps.
    ///
    /// # Errors
    /// [`LearnError::Shape`], [`LearnError::Action`] or [`LearnError::Config`] if the rollout does not fit, and
    /// [`LearnError::Input`] if it holds numbers that are not finite, before anything is changed;
    /// [`LearnError::NotFinite`] and [`LearnError::Exploded`] name what ran away, and the learner is of no further use
    /// then.
    pub fn update(&mut self, rollout: &Rollout) -> Result<UpdateMetrics, LearnError> {
        among_workers(|| self.update_here(rollout))
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
        let batch = Batch {
            rollout,
            advantages: estimate.advantages,
            returns: estimate.returns,
            teacher: self.teacher_output(rollout)?,
            latent: self.base.spec.latent,
            stats: self.base.obs_stats(),
            norm_adv: config.norm_adv,
        };
        let lr = config.lr_at(self.base.updates);
        let mut rng = self.base.streams.stream("ppo.minibatches", self.base.updates);
        let mut rows: Vec<usize> = (0..rollout.rows()).collect();
        let (n, parts) = (rows.len(), config.minibatches.min(rows.len()));
        let mut sum = StepMetrics::default();
        for _ in 0..self.config.epochs {
            shuffle(&mut rows, &mut rng);
            for part in 0..parts {
                let minibatch =
                    batch.minibatch(&rows[part * n / parts..(part + 1) * n / parts], &self.base.device.plain());
                let score = self.base.score_config();
                sum.add(&gradient_step(&mut self.nets, &mut self.adam, &minibatch, &self.config, score, lr)?);
            }
        }
        self.base.updates += 1;
        if let (Some(normalizer), Observations::Vector(values)) = (&mut self.base.observations, &rollout.obs) {
            normalizer.update(values);
        }
        let steps = self.config.epochs * parts;
        Ok(UpdateMetrics::mean(&sum, steps, batch.teacher.is_some(), explained_variance, lr))
    }

    /// What the decoder says about the whole rollout: it is frozen, so once per update is enough.
    fn teacher_output(&self, rollout: &Rollout) -> Result<Option<TeacherOutput>, LearnError> {
        let Some(teacher) = &self.base.teacher else { return Ok(None) };
        let mut rng = self.base.streams.stream("score.own_samples", self.base.updates);
        let states = StateBatch { z: &rollout.z, obs: rollout.obs.as_slice(), n: rollout.rows() };
        teacher.output(states, &rollout.actions, false, &mut rng, self.base.device)
    }
}

impl Batch<'_> {
    fn minibatch(&self, rows: &[usize], device: &Device) -> Minibatch {
        let rollout = self.rollout;
        let pick = |values: &[f32]| -> Vec<f32> { rows.iter().map(|&r| values[r]).collect() };
        let inputs = InputBuilder {
            z: &rollout.z,
            latent: self.latent,
            obs: rollout.obs.as_slice(),
            kind: &rollout.obs_kind,
            stats: self.stats.as_deref(),
        };
        let mut advantages = pick(&self.advantages);
        if self.norm_adv {
            normalize_advantages(&mut advantages);
        }
        Minibatch {
            inputs: inputs.input(rows, device),
            ppo: PpoBatch {
                actions: ActionBatch::new(&rollout.actions.gather(rows), device),
                old_log_probs: vector(pick(&rollout.log_probs), device),
                advantages: vector(advantages, device),
                old_values: vector(pick(&rollout.values), device),
                returns: vector(pick(&self.returns), device),
            },
            teacher: self.teacher.as_ref().map(|teacher| teacher.batch(rows, device)),
        }
    }
}

/// Loss, gradient, clipping by the global norm, one step of Adam on tracked `nets`.
///
/// With a decoder in `batch` and settings of SCORE, kl_coef times the [`penalty`] is added to the loss.
///
/// # Errors
/// [`LearnError::NotFinite`] names the first loss, gradient or weight that is not finite, [`LearnError::Exploded`] the
/// first loss beyond all bounds; [`LearnError::Config`] if the networks do not read such observations.
pub fn gradient_step(
    nets: &mut PpoNets,
    adam: &mut Adam,
    batch: &Minibatch,
    config: &PpoConfig,
    score: Option<&ScoreConfig>,
    lr: f64,
) -> Result<StepMetrics, LearnError> {
    let inputs = nets.actor.join(&batch.inputs)?;
    let dist = nets.actor.forward(inputs.clone());
    let values = nets.critic.forward(inputs);
    let loss = ppo_loss(&dist, values, &batch.ppo, config.clip, config.clip_value_loss)?;
    let steps = adam.steps();
    let mut metrics = StepMetrics {
        policy_loss: finite("policy_loss", &loss.policy_loss, steps)?,
        value_loss: finite("value_loss", &loss.value_loss, steps)?,
        entropy: finite("entropy", &loss.entropy, steps)?,
        ..StepMetrics::default()
    };
    let mut total = loss.policy_loss - loss.entropy * config.ent_coef + loss.value_loss * config.vf_coef;
    if let (Some(teacher), Some(score)) = (&batch.teacher, score) {
        let Penalty { kl, term } = penalty(score, &teacher.dist, &dist, teacher.confidence.clone())?;
        metrics.decoder_kl = finite("decoder_kl", &kl.mean(), steps)?;
        metrics.kl_penalty = finite("kl_penalty", &term, steps)?;
        metrics.confidence = teacher.mean_confidence;
        total = total + term * score.kl_coef;
    }
    let ratios = ratio_stats(&host(loss.log_ratio.inner())?, config.clip);
    metrics.approx_kl = ratios.approx_kl;
    metrics.clip_fraction = ratios.clip_fraction;
    metrics.total_loss = finite("total_loss", &total, steps)?;
    let grads = NamedGrads::take(nets, "", total.backward())?;
    let (norm, scale) = grads.clip_factor(config.max_grad_norm, adam.steps())?;
    metrics.grad_norm = norm;
    adam.step(nets, "", &grads, lr, scale)?;
    Ok(metrics)
}

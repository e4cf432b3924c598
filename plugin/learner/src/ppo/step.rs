//! One gradient step: minibatch → loss → gradient → Adam.

use super::augmented::augmentation_loss;
use super::host_loss::HostLoss;
use super::objective::{PpoBatch, PpoLoss, ppo_loss};
use super::{PpoConfig, PpoNets, StepMetrics, ratio_stats};
use crate::LearnError;
use crate::device::is_host;
use crate::nn::{Adam, Dist, NamedGrads, finite, host};
use crate::policy::NetInput;
use crate::score::{Penalty, ScoreConfig, TeacherBatch, penalty};
use burn::tensor::Tensor;

/// One minibatch on the device.
#[derive(Clone, Debug)]
pub struct Minibatch {
    /// What actor and critic read.
    pub inputs: NetInput,
    /// The same after the changes that they shall not mind; `None` without any.
    pub augmented: Option<NetInput>,
    /// What is left of each skill, `[n]`, if somebody has counted.
    pub left: Option<Tensor<1>>,
    /// Constants of the PPO loss.
    pub ppo: PpoBatch,
    /// Constants of the penalty, if there is one.
    pub teacher: Option<TeacherBatch>,
}

/// The terms of a minibatch's loss.
#[derive(Debug)]
pub(super) struct Losses {
    pub(super) ppo: PpoLoss,
    pub(super) penalty: Option<Penalty>,
    /// What is minimised.
    pub(super) total: Tensor<1>,
}

impl Losses {
    /// Of what actor and critic gave for `batch`. With a decoder in `batch` and settings of SCORE, kl_coef times the [`penalty`] is added. While the
    /// critic warms up its loss is all that is minimised.
    ///
    /// # Errors
    /// [`LearnError::Action`] if policy, decoder and actions differ in kind.
    pub(super) fn of(
        dist: &Dist,
        values: Tensor<1>,
        batch: &Minibatch,
        config: &PpoConfig,
        &Moment { score, is_warming_up, .. }: &Moment<'_>,
    ) -> Result<Self, LearnError> {
        let ppo = ppo_loss(dist, values, &batch.ppo, config.clip, config.clip_value_loss)?;
        let of_critic = ppo.value_loss.clone() * config.vf_coef;
        let mut total = match is_warming_up {
            true => of_critic,
            false => ppo.policy_loss.clone() - ppo.entropy.clone() * config.ent_coef + of_critic,
        };
        let mut penalised = None;
        if let (Some(teacher), Some(score)) = (&batch.teacher, score) {
            let found = penalty(score, &teacher.dist, dist, teacher.confidence.clone())?;
            if !is_warming_up {
                total = total + found.term.clone() * score.kl_coef;
            }
            penalised = Some(found);
        }
        Ok(Self { ppo, penalty: penalised, total })
    }

    /// In plain numbers, but for the norm of the gradient; all are checked.
    pub(super) fn metrics(&self, batch: &Minibatch, config: &PpoConfig, steps: u64) -> Result<StepMetrics, LearnError> {
        let mut metrics = StepMetrics {
            policy_loss: finite("policy_loss", &self.ppo.policy_loss, steps)?,
            value_loss: finite("value_loss", &self.ppo.value_loss, steps)?,
            entropy: finite("entropy", &self.ppo.entropy, steps)?,
            ..StepMetrics::default()
        };
        if let (Some(teacher), Some(Penalty { kl, term })) = (&batch.teacher, &self.penalty) {
            metrics.decoder_kl = finite("decoder_kl", &kl.clone().mean(), steps)?;
            metrics.kl_penalty = finite("kl_penalty", term, steps)?;
            metrics.confidence = teacher.mean_confidence;
        }
        let ratios = ratio_stats(&host(self.ppo.log_ratio.clone().inner())?, config.clip);
        metrics.approx_kl = ratios.approx_kl;
        metrics.clip_fraction = ratios.clip_fraction;
        metrics.total_loss = finite("total_loss", &self.total, steps)?;
        Ok(metrics)
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
    let part = std::iter::once((batch.clone(), 1.0));
    step_in_parts(nets, adam, part, config, &Moment { lr, score, is_warming_up: false })
}

/// What changes from update to update.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment<'a> {
    /// Learning rate.
    pub(super) lr: f64,
    /// Settings of SCORE, with the weight that the penalty has come to.
    pub(super) score: Option<&'a ScoreConfig>,
    /// Whether only the critic learns.
    pub(super) is_warming_up: bool,
}

/// What is minimised, with what a step reports of it.
fn loss(
    nets: &PpoNets,
    batch: &Minibatch,
    config: &PpoConfig,
    moment: &Moment<'_>,
    steps: u64,
) -> Result<(Tensor<1>, StepMetrics), LearnError> {
    let (dist, values) = outputs(nets, &batch.inputs, batch, config, moment)?;
    let augmentation = augmentation_loss(nets, &dist, &values, batch, config, moment)?;
    let (total, metrics) = if is_host(&values.device()) && HostLoss::is_for(moment) {
        let loss = HostLoss::of(&dist, &values, batch, config, moment, steps)?;
        let metrics = loss.metrics;
        (loss.tensor(&dist, values), metrics)
    } else {
        let losses = Losses::of(&dist, values, batch, config, moment)?;
        let metrics = losses.metrics(batch, config, steps)?;
        (losses.total, metrics)
    };
    let Some(augmentation) = augmentation else { return Ok((total, metrics)) };
    let augmentation_loss = finite("augmentation_loss", &augmentation, steps)?;
    let total_loss = metrics.total_loss + config.augment_coef * augmentation_loss;
    Ok((total + augmentation * config.augment_coef, StepMetrics { augmentation_loss, total_loss, ..metrics }))
}

/// What actor and critic say to `inputs`: those of `batch`, or changed ones.
pub(super) fn outputs(
    nets: &PpoNets,
    inputs: &NetInput,
    batch: &Minibatch,
    config: &PpoConfig,
    moment: &Moment<'_>,
) -> Result<(Dist, Tensor<1>), LearnError> {
    let inputs = nets.actor.join(inputs)?;
    let dist = nets.actor.forward(inputs.clone());
    let is_apart = moment.is_warming_up || !config.critic_trains_cnn;
    Ok((dist, nets.critic.forward(if is_apart { inputs.detach() } else { inputs }, batch.left.clone())))
}

/// [`gradient_step`] on a minibatch that comes in parts, each with its share of the rows.
pub(super) fn step_in_parts(
    nets: &mut PpoNets,
    adam: &mut Adam,
    parts: impl Iterator<Item = (Minibatch, f64)>,
    config: &PpoConfig,
    moment: &Moment<'_>,
) -> Result<StepMetrics, LearnError> {
    let (mut metrics, mut sum) = (StepMetrics::default(), NamedGrads::default());
    let steps = adam.steps();
    for (part, share) in parts {
        let (total, of_part) = loss(nets, &part, config, moment, steps)?;
        metrics.add(&of_part, share);
        // A whole minibatch is not multiplied by 1.
        let total = if share < 1.0 { total * share } else { total };
        sum.add(NamedGrads::take(nets, "", total.backward())?);
    }
    let (norm, scale) = sum.clip_factor(config.max_grad_norm, steps)?;
    metrics.grad_norm = norm;
    adam.step(nets, "", &sum, moment.lr, scale)?;
    Ok(metrics)
}

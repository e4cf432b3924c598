//! One gradient step: minibatch → loss → gradient → Adam.

use super::augmented::augmentation_loss;
use super::host_loss::HostLoss;
use super::objective::{PpoBatch, PpoLoss, ppo_loss};
use super::{PpoConfig, PpoNets, StepMetrics, ratio_stats};
use crate::LearnError;
use crate::device::is_host;
use crate::nn::{Adam, Dist, NamedGrads, finite, host, scalar};
use crate::policy::NetInput;
use crate::score::{Penalty, ScoreConfig, TeacherBatch, penalty};
use burn::tensor::Tensor;

/// One minibatch on the device.
#[derive(Clone, Debug)]
pub struct Minibatch {
    /// Inputs of actor and critic.
    pub inputs: NetInput,
    /// The same after augmentation; `None` without any.
    pub augmented: Option<NetInput>,
    /// Remaining share of each skill, `[n]`, if ticks are counted.
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
    /// The minimised total.
    pub(super) total: Tensor<1>,
}

impl Losses {
    /// Computes the terms from the outputs of actor and critic for `batch`. With a decoder in `batch` and settings of
    /// SCORE, kl_coef times the [`penalty`] is added. While the critic warms up only its loss is minimised.
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

    /// Returns the terms as plain numbers, except for the norm of the gradient; all are checked.
    pub(super) fn metrics(&self, batch: &Minibatch, config: &PpoConfig, steps: u64) -> Result<StepMetrics, LearnError> {
        let number = |tensor: &Tensor<1>| scalar(tensor.clone().inner()).map(f64::from);
        let ratios = ratio_stats(&host(self.ppo.log_ratio.clone().inner())?, config.clip);
        let mut metrics = StepMetrics {
            policy_loss: number(&self.ppo.policy_loss)?,
            value_loss: number(&self.ppo.value_loss)?,
            entropy: number(&self.ppo.entropy)?,
            approx_kl: ratios.approx_kl,
            clip_fraction: ratios.clip_fraction,
            total_loss: number(&self.total)?,
            ..StepMetrics::default()
        };
        if let (Some(teacher), Some(Penalty { kl, term })) = (&batch.teacher, &self.penalty) {
            metrics.decoder_kl = number(&kl.clone().mean())?;
            metrics.kl_penalty = number(term)?;
            metrics.confidence = teacher.mean_confidence;
        }
        metrics.check_losses(steps)?;
        Ok(metrics)
    }
}

/// Computes loss and gradient, clips by the global norm, and does one step of Adam on tracked `nets`.
///
/// With a decoder in `batch` and settings of SCORE, kl_coef times the [`penalty`] is added to the loss.
///
/// # Errors
/// [`LearnError::NotFinite`] names the first loss, gradient or weight that is not finite, [`LearnError::Exploded`]
/// the first loss beyond all bounds; [`LearnError::Config`] if the networks do not read such observations.
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

/// Settings that change from update to update.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment<'a> {
    /// Learning rate.
    pub(super) lr: f64,
    /// Settings of SCORE, with the present weight of the penalty.
    pub(super) score: Option<&'a ScoreConfig>,
    /// True if only the critic learns.
    pub(super) is_warming_up: bool,
}

/// Returns the minimised loss, with its metrics.
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

/// Returns the outputs of actor and critic for `inputs`: those of `batch`, or augmented ones.
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

/// Does [`gradient_step`] on a minibatch that comes in parts, each with its share of the rows.
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

//! One gradient step.

use super::batch::Minibatch;
use super::{PpoConfig, PpoNets, ppo_loss, ratio_stats};
use crate::LearnError;
use crate::nn::{Adam, NamedGrads, finite, host};
use crate::score::{Penalty, ScoreConfig, penalty};

/// What one gradient step looked like, before it was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepMetrics {
    /// Clipped surrogate loss.
    pub policy_loss: f64,
    /// Value loss, with its ½ and without its weight.
    pub value_loss: f64,
    /// Entropy in nats.
    pub entropy: f64,
    /// The loss that was minimised.
    pub total_loss: f64,
    /// mean(ratio - 1 - ln ratio).
    pub approx_kl: f64,
    /// Share of |ratio - 1| > clip.
    pub clip_fraction: f64,
    /// Mean divergence between decoder and policy, not weighted.
    pub decoder_kl: f64,
    /// mean(α · divergence), or the legacy form of it, without kl_coef.
    pub kl_penalty: f64,
    /// Mean of α.
    pub alpha_mean: f64,
    /// Norm of the gradient before clipping.
    pub grad_norm: f64,
}

impl StepMetrics {
    pub(super) fn add(&mut self, other: &Self) {
        self.policy_loss += other.policy_loss;
        self.value_loss += other.value_loss;
        self.entropy += other.entropy;
        self.total_loss += other.total_loss;
        self.approx_kl += other.approx_kl;
        self.clip_fraction += other.clip_fraction;
        self.decoder_kl += other.decoder_kl;
        self.kl_penalty += other.kl_penalty;
        self.alpha_mean += other.alpha_mean;
        self.grad_norm += other.grad_norm;
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
    if let (Some(decoder), Some(score)) = (&batch.decoder, score) {
        let Penalty { kl, term } = penalty(score, &decoder.dist, &dist, decoder.alpha.clone())?;
        metrics.decoder_kl = finite("decoder_kl", &kl.mean(), steps)?;
        metrics.kl_penalty = finite("kl_penalty", &term, steps)?;
        metrics.alpha_mean = decoder.alpha_mean;
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

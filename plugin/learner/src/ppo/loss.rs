//! The losses of PPO, as pure functions of tensors.

use crate::LearnError;
use crate::nn::{ActionRows, Dist};
use burn::tensor::Tensor;

/// The constants of one minibatch, `[n]` each.
#[derive(Clone, Debug)]
pub struct PpoBatch {
    /// The actions taken.
    pub actions: ActionRows,
    /// Their log-probabilities when taken.
    pub old_log_probs: Tensor<1>,
    /// Advantages, normalised if that is wanted.
    pub advantages: Tensor<1>,
    /// Values when the observations were seen.
    pub old_values: Tensor<1>,
    /// Returns.
    pub returns: Tensor<1>,
}

/// The terms of the loss; `[1]` each but for the log-ratios.
#[derive(Clone, Debug)]
pub struct PpoLoss {
    /// mean(max(-A ratio, -A clip(ratio))).
    pub policy_loss: Tensor<1>,
    /// ½ mean((V - R)²), or the clipped form.
    pub value_loss: Tensor<1>,
    /// Mean entropy in nats.
    pub entropy: Tensor<1>,
    /// ln(new probability / old probability), `[n]`.
    pub log_ratio: Tensor<1>,
}

/// The clipped surrogate objective, the value loss (clipped if `clip_value`) and the entropy.
///
/// The loss to minimise is policy_loss - ent_coef · entropy + vf_coef · value_loss.
///
/// # Errors
/// [`LearnError::Action`] if the actions do not fit the distribution.
pub fn ppo_loss(
    dist: &Dist,
    values: Tensor<1>,
    batch: &PpoBatch,
    clip: f64,
    clip_value: bool,
) -> Result<PpoLoss, LearnError> {
    let log_ratio = dist.log_prob(&batch.actions)? - batch.old_log_probs.clone();
    let ratio = log_ratio.clone().exp();
    let gain = batch.advantages.clone().neg();
    let clipped = ratio.clone().clamp(1.0 - clip, 1.0 + clip);
    let policy_loss = (gain.clone() * ratio).max_pair(gain * clipped).mean();

    let error = (values.clone() - batch.returns.clone()).square();
    let error = if clip_value {
        let old = batch.old_values.clone();
        let near = old.clone() + (values - old).clamp(-clip, clip);
        error.max_pair((near - batch.returns.clone()).square())
    } else {
        error
    };
    let value_loss = error.mean() * 0.5;
    Ok(PpoLoss { policy_loss, value_loss, entropy: dist.entropy().mean(), log_ratio })
}

/// (A - mean) / (deviation + 1e-8) with the unbiased deviation. A single advantage becomes 0.
pub fn normalize_advantages(advantages: &mut [f32]) {
    let n = advantages.len() as f64;
    let mean = advantages.iter().map(|&a| f64::from(a)).sum::<f64>() / n;
    let squares: f64 = advantages.iter().map(|&a| (f64::from(a) - mean).powi(2)).sum();
    let std = (squares / (n - 1.0).max(1.0)).sqrt();
    for a in advantages {
        *a = ((f64::from(*a) - mean) / (std + 1e-8)) as f32;
    }
}

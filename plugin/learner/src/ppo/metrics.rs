//! What a gradient step and an update report.

use serde::{Deserialize, Serialize};

/// Means over all minibatches of an update.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, Default, PartialEq)]
pub struct UpdateMetrics {
    /// Clipped surrogate loss.
    pub policy_loss: f32,
    /// Value loss, with its ½ and without its weight.
    pub value_loss: f32,
    /// Entropy in nats. Of continuous actions it is that of the Gaussian before the game clips: Σ ln σ + 1.42 for each
    /// dimension, which may be negative.
    pub entropy: f32,
    /// Estimate of KL(old ‖ new) in nats: mean(ratio - 1 - ln ratio).
    pub approx_kl: f32,
    /// Share of rows whose ratio was clipped.
    pub clip_fraction: f32,
    /// 1 - Var(R - V) / Var(R) of the rollout's own values; NaN if the returns are all equal.
    pub explained_variance: f32,
    /// Mean divergence between decoder and policy in nats, not weighted; `None` without a penalty.
    pub decoder_kl: Option<f32>,
    /// Mean of the decoder's confidence, α in the paper; `None` without a penalty.
    #[serde(rename = "alpha_mean")]
    pub confidence: Option<f32>,
    /// How much actor and critic mind changed pictures, not weighted; `None` without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub augmentation_loss: Option<f32>,
    /// Norm of the gradient before clipping.
    pub grad_norm: f32,
    /// The learning rate used.
    pub lr: f32,
}

/// Which terms a loss has beside those of PPO.
#[derive(Clone, Copy, Debug)]
pub(super) struct Has {
    pub(super) penalty: bool,
    pub(super) augmentation: bool,
}

impl UpdateMetrics {
    /// The means over `steps` gradient steps whose metrics add up to `sum`.
    pub(super) fn mean(sum: &StepMetrics, steps: usize, has: Has, explained_variance: f64, lr: f64) -> Self {
        let mean = |total: f64| (total / steps as f64) as f32;
        Self {
            policy_loss: mean(sum.policy_loss),
            value_loss: mean(sum.value_loss),
            entropy: mean(sum.entropy),
            approx_kl: mean(sum.approx_kl),
            clip_fraction: mean(sum.clip_fraction),
            explained_variance: explained_variance as f32,
            decoder_kl: has.penalty.then(|| mean(sum.decoder_kl)),
            confidence: has.penalty.then(|| mean(sum.confidence)),
            augmentation_loss: has.augmentation.then(|| mean(sum.augmentation_loss)),
            grad_norm: mean(sum.grad_norm),
            lr: lr as f32,
        }
    }

    /// The numbers by their TensorBoard tags; what was not measured is left out.
    pub fn scalars(&self) -> Vec<(&'static str, f64)> {
        let all = [
            ("charts/learning_rate", Some(self.lr)),
            ("losses/policy_loss", Some(self.policy_loss)),
            ("losses/value_loss", Some(self.value_loss)),
            ("losses/entropy", Some(self.entropy)),
            ("losses/approx_kl", Some(self.approx_kl)),
            ("losses/clip_fraction", Some(self.clip_fraction)),
            ("losses/explained_variance", Some(self.explained_variance)),
            ("losses/augmentation_loss", self.augmentation_loss),
            ("losses/grad_norm", Some(self.grad_norm)),
            ("score/decoder_kl", self.decoder_kl),
            ("score/alpha_mean", self.confidence),
        ];
        all.into_iter().filter_map(|(tag, value)| Some((tag, f64::from(value?)))).collect()
    }
}

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
    /// mean(confidence · divergence), or the legacy form of it, without kl_coef.
    pub kl_penalty: f64,
    /// Mean of the decoder's confidence.
    pub confidence: f64,
    /// How much actor and critic mind changed pictures, not weighted.
    pub augmentation_loss: f64,
    /// Norm of the gradient before clipping.
    pub grad_norm: f64,
}

impl StepMetrics {
    /// Adds each number times `share`.
    pub(super) fn add(&mut self, other: &Self, share: f64) {
        self.policy_loss += other.policy_loss * share;
        self.value_loss += other.value_loss * share;
        self.entropy += other.entropy * share;
        self.total_loss += other.total_loss * share;
        self.approx_kl += other.approx_kl * share;
        self.clip_fraction += other.clip_fraction * share;
        self.decoder_kl += other.decoder_kl * share;
        self.kl_penalty += other.kl_penalty * share;
        self.confidence += other.confidence * share;
        self.augmentation_loss += other.augmentation_loss * share;
        self.grad_norm += other.grad_norm * share;
    }
}

/// How far a policy has moved from the one that played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatioStats {
    /// mean(ratio - 1 - ln ratio).
    pub approx_kl: f64,
    /// mean(-ln ratio).
    pub old_approx_kl: f64,
    /// Share of |ratio - 1| > clip.
    pub clip_fraction: f64,
}

/// Statistics of `log_ratios` = ln(new probability / old probability).
pub fn ratio_stats(log_ratios: &[f32], clip: f64) -> RatioStats {
    let n = log_ratios.len().max(1) as f64;
    let (mut kl, mut old, mut clipped) = (0.0, 0.0, 0.0);
    for &l in log_ratios {
        let l = f64::from(l);
        let moved = l.exp_m1();
        kl += moved - l;
        old -= l;
        if moved.abs() > clip {
            clipped += 1.0;
        }
    }
    RatioStats { approx_kl: kl / n, old_approx_kl: old / n, clip_fraction: clipped / n }
}

/// 1 - Var(returns - values) / Var(returns); NaN if the returns do not vary.
pub fn explained_variance(values: &[f32], returns: &[f32]) -> f64 {
    let errors = values.iter().zip(returns).map(|(v, r)| f64::from(*r) - f64::from(*v));
    let spread = variance(returns.iter().map(|&r| f64::from(r)));
    if spread == 0.0 { f64::NAN } else { 1.0 - variance(errors) / spread }
}

fn variance(values: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.clone().sum::<f64>() / n;
    values.map(|x| (x - mean).powi(2)).sum::<f64>() / n
}

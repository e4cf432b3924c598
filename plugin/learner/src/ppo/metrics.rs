//! Metrics of a gradient step and of an update.

use crate::{LearnError, nn::check_loss};
use serde::{Deserialize, Serialize};

/// Means over all minibatches of an update.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, Default, PartialEq)]
pub struct UpdateMetrics {
    /// Clipped surrogate loss.
    pub policy_loss: f32,
    /// Value loss, with its ½ and without its weight.
    pub value_loss: f32,
    /// Entropy in nats. Of continuous actions it is that of the Gaussian before the game clips: Σ ln σ + 1.42 for
    /// each dimension, which may be negative.
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
    /// Sensitivity of actor and critic to augmentations, not weighted; `None` without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub augmentation_loss: Option<f32>,
    /// Value loss of intrinsic rewards, with its ½ and without its weight; `None` without curiosity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsic_value_loss: Option<f32>,
    /// Mean intrinsic reward of a step, divided by the running deviation of the discounted return; `None` without
    /// curiosity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsic_reward: Option<f32>,
    /// Mean squared error of the predictor on what it learned from, before each of its steps; `None` without curiosity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predictor_loss: Option<f32>,
    /// Norm of the gradient before clipping.
    pub grad_norm: f32,
    /// The learning rate used.
    pub lr: f32,
}

/// The optional terms of a loss beside those of PPO.
#[derive(Clone, Copy, Debug)]
pub(super) struct Has {
    pub(super) penalty: bool,
    pub(super) augmentation: bool,
    /// Mean intrinsic reward, and mean loss of the predictor.
    pub(super) curiosity: Option<(f64, f64)>,
}

impl UpdateMetrics {
    /// Returns the means over `steps` gradient steps whose metrics add up to `sum`.
    pub(super) fn mean(sum: &StepMetrics, steps: usize, has: Has, explained_variance: f64, lr: f64) -> Self {
        let mean = sum.map(|total| (total / steps as f64) as f32);
        Self {
            policy_loss: mean.policy_loss,
            value_loss: mean.value_loss,
            entropy: mean.entropy,
            approx_kl: mean.approx_kl,
            clip_fraction: mean.clip_fraction,
            explained_variance: explained_variance as f32,
            decoder_kl: has.penalty.then_some(mean.decoder_kl),
            confidence: has.penalty.then_some(mean.confidence),
            augmentation_loss: has.augmentation.then_some(mean.augmentation_loss),
            intrinsic_value_loss: has.curiosity.map(|_| mean.intrinsic_value_loss),
            intrinsic_reward: has.curiosity.map(|(reward, _)| reward as f32),
            predictor_loss: has.curiosity.map(|(_, loss)| loss as f32),
            grad_norm: mean.grad_norm,
            lr: lr as f32,
        }
    }

    /// Returns the numbers by their TensorBoard tags; unmeasured ones are left out.
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
            ("losses/intrinsic_value_loss", self.intrinsic_value_loss),
            ("losses/grad_norm", Some(self.grad_norm)),
            ("score/decoder_kl", self.decoder_kl),
            ("score/alpha_mean", self.confidence),
            ("curiosity/intrinsic_reward", self.intrinsic_reward),
            ("curiosity/predictor_loss", self.predictor_loss),
        ];
        all.into_iter().filter_map(|(tag, value)| Some((tag, f64::from(value?)))).collect()
    }
}

/// Defines [`StepMetrics`], the only list of the names of a gradient step's metrics.
macro_rules! step_metrics {
    (
        losses { $($(#[$loss_doc:meta])* $loss:ident,)* }
        others { $($(#[$doc:meta])* $other:ident,)* }
    ) => {
        /// Metrics of one gradient step, before it was taken.
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct StepMetrics<T = f64> {
            $($(#[$loss_doc])* pub $loss: T,)*
            $($(#[$doc])* pub $other: T,)*
        }

        impl<T> StepMetrics<T> {
            /// Converts each metric, in the order of the fields.
            pub(super) fn map<U>(self, mut convert: impl FnMut(T) -> U) -> StepMetrics<U> {
                StepMetrics {
                    $($loss: convert(self.$loss),)*
                    $($other: convert(self.$other),)*
                }
            }
        }

        impl StepMetrics {
            /// Adds each number times `share`.
            pub(super) fn add(&mut self, other: &Self, share: f64) {
                $(self.$loss += other.$loss * share;)*
                $(self.$other += other.$other * share;)*
            }

            /// Checks the losses after so many steps of the optimizer, in the order of the fields.
            ///
            /// # Errors
            /// [`LearnError::NotFinite`] and [`LearnError::Exploded`] name the first loss that diverged.
            pub(super) fn check_losses(&self, steps: u64) -> Result<(), LearnError> {
                $(check_loss(stringify!($loss), self.$loss as f32, steps)?;)*
                Ok(())
            }
        }
    };
}

step_metrics! {
    losses {
        /// Clipped surrogate loss.
        policy_loss,
        /// Value loss, with its ½ and without its weight.
        value_loss,
        /// Entropy in nats.
        entropy,
        /// Mean divergence between decoder and policy, not weighted.
        decoder_kl,
        /// mean(confidence · divergence), or the legacy form of it, without kl_coef.
        kl_penalty,
        /// The loss that was minimised.
        total_loss,
    }
    others {
        /// mean(ratio - 1 - ln ratio).
        approx_kl,
        /// Share of |ratio - 1| > clip.
        clip_fraction,
        /// Mean of the decoder's confidence.
        confidence,
        /// Divergence of actor and critic on augmented images, not weighted.
        augmentation_loss,
        /// Value loss of intrinsic rewards, without its weight.
        intrinsic_value_loss,
        /// Norm of the gradient before clipping.
        grad_norm,
    }
}

/// Distance of a policy from the one that played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatioStats {
    /// mean(ratio - 1 - ln ratio).
    pub approx_kl: f64,
    /// mean(-ln ratio).
    pub old_approx_kl: f64,
    /// Share of |ratio - 1| > clip.
    pub clip_fraction: f64,
}

/// Returns statistics of `log_ratios` = ln(new probability / old probability).
pub fn ratio_stats(log_ratios: &[f32], clip: f64) -> RatioStats {
    let n = log_ratios.len().max(1) as f64;
    let (mut kl, mut old, mut clipped) = (0.0, 0.0, 0.0);
    for &l in log_ratios {
        let l = f64::from(l);
        let moved = libm::expm1(l);
        kl += moved - l;
        old -= l;
        if moved.abs() > clip {
            clipped += 1.0;
        }
    }
    RatioStats { approx_kl: kl / n, old_approx_kl: old / n, clip_fraction: clipped / n }
}

/// Returns 1 - Var(returns - values) / Var(returns); NaN if the returns do not vary.
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

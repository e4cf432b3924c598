//! Metrics of an update.

use crate::sac::{ActorStep, CriticStep, TemperatureStep};
use serde::{Deserialize, Serialize};

/// Means over all gradient steps of an update; `None` if not done or not measured.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, Default, PartialEq)]
pub struct SacMetrics {
    /// Transitions added so far.
    pub transitions: u64,
    /// Gradient steps of the critics so far.
    pub gradient_steps: u64,
    /// Mean squared error of a critic, the mean of all.
    pub qf_loss: Option<f32>,
    /// Mean value of the transitions' actions by the critics.
    pub qf_values: Option<f32>,
    /// Norm of the critics' gradient.
    pub critic_grad_norm: Option<f32>,
    /// -mean(V) of the actor, without SCORE's penalty.
    pub actor_loss: Option<f32>,
    /// Estimated entropy of the policy in nats (differential if continuous, so it may be negative).
    pub entropy: Option<f32>,
    /// Norm of the actor's gradient.
    pub actor_grad_norm: Option<f32>,
    /// Loss of the temperature; `None` if that is fixed.
    #[serde(rename = "alpha_loss")]
    pub temperature_loss: Option<f32>,
    /// The temperature at the end of the update; `None` without a gradient step.
    pub entropy_coef: Option<f32>,
    /// Mean divergence between decoder and policy in nats, not weighted; `None` without a penalty.
    pub decoder_kl: Option<f32>,
    /// Mean of the decoder's confidence; `None` without a penalty.
    #[serde(rename = "alpha_mean")]
    pub confidence: Option<f32>,
}

impl SacMetrics {
    /// Returns the numbers by their TensorBoard tags; unmeasured ones are left out.
    pub fn scalars(&self) -> Vec<(&'static str, f64)> {
        let counters =
            [("charts/transitions", self.transitions as f64), ("charts/gradient_steps", self.gradient_steps as f64)];
        let measured = [
            ("charts/entropy_coef", self.entropy_coef),
            ("losses/qf_loss", self.qf_loss),
            ("losses/qf_values", self.qf_values),
            ("losses/critic_grad_norm", self.critic_grad_norm),
            ("losses/actor_loss", self.actor_loss),
            ("losses/entropy", self.entropy),
            ("losses/actor_grad_norm", self.actor_grad_norm),
            ("losses/temperature_loss", self.temperature_loss),
            ("score/decoder_kl", self.decoder_kl),
            ("score/alpha_mean", self.confidence),
        ];
        let measured = measured.into_iter().filter_map(|(tag, value)| Some((tag, f64::from(value?))));
        counters.into_iter().chain(measured).collect()
    }
}

/// Sums over the gradient steps of an update.
#[derive(Default)]
pub(super) struct MetricSums {
    critics: (CriticStep, u64),
    actor: (ActorStep, u64),
    temperature: (TemperatureStep, u64),
}

impl MetricSums {
    pub(super) fn add_critics(&mut self, step: &CriticStep) {
        let (sum, count) = &mut self.critics;
        sum.losses.resize(step.losses.len(), 0.0);
        sum.losses.iter_mut().zip(&step.losses).for_each(|(sum, loss)| *sum += loss);
        sum.q_values += step.q_values;
        sum.grad_norm += step.grad_norm;
        *count += 1;
    }

    pub(super) fn add_actor(&mut self, step: &ActorStep) {
        let (sum, count) = &mut self.actor;
        sum.actor_loss += step.actor_loss;
        sum.entropy += step.entropy;
        sum.decoder_kl += step.decoder_kl;
        sum.confidence += step.confidence;
        sum.grad_norm += step.grad_norm;
        *count += 1;
    }

    pub(super) fn add_temperature(&mut self, step: &TemperatureStep) {
        let (sum, count) = &mut self.temperature;
        sum.temperature_loss += step.temperature_loss;
        *count += 1;
    }

    /// Returns the means; counters and the temperature are left to the caller.
    pub(super) fn means(&self, penalised: bool) -> SacMetrics {
        let mean = |total: f64, count: u64| (count > 0).then(|| (total / count as f64) as f32);
        let (critics, n) = &self.critics;
        let (actor, m) = &self.actor;
        let (temperature, k) = &self.temperature;
        SacMetrics {
            qf_loss: mean(critics.losses.iter().sum::<f64>() / critics.losses.len().max(1) as f64, *n),
            qf_values: mean(critics.q_values, *n),
            critic_grad_norm: mean(critics.grad_norm, *n),
            actor_loss: mean(actor.actor_loss, *m),
            entropy: mean(actor.entropy, *m),
            actor_grad_norm: mean(actor.grad_norm, *m),
            temperature_loss: mean(temperature.temperature_loss, *k),
            decoder_kl: mean(actor.decoder_kl, *m).filter(|_| penalised),
            confidence: mean(actor.confidence, *m).filter(|_| penalised),
            ..SacMetrics::default()
        }
    }
}

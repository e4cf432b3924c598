//! Metrics of a skill model's training.

use super::HeldOutMetrics;
use crate::nn::{Dist, argmax, host};
use crate::{Actions, LearnError};

/// Metrics of one batch, or their mean over an epoch's batches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SkillMetrics {
    /// The whole loss.
    pub loss: f32,
    /// Negative log-likelihood of a window's actions, in nats (see [`super::Reduction`]).
    pub nll: f32,
    /// KL from the encoder to the prior, in nats.
    pub kl: f32,
    /// Mean Euclidean norm of the decoder's latent.
    pub latent_norm: f32,
    /// Share of steps whose action is the decoder's most likely one; `None` for continuous actions.
    pub accuracy: Option<f32>,
    /// Norm of the gradient before clipping.
    pub grad_norm: f32,
    /// Squared error of the predicted state, the mean over its numbers and summed over a window, with
    /// [`state_weight`](super::SkillConfig::state_weight); it starts near the number of steps of a window plus 1.
    pub state_error: Option<f32>,
    /// Metrics of an epoch's networks on held-out demonstrations; `None` for a single batch, and without any.
    pub held_out: Option<HeldOutMetrics>,
}

/// Sums over the running epoch's batches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct MetricSums {
    pub(super) count: usize,
    pub(super) total: [f64; 7],
}

impl MetricSums {
    pub(super) fn add(&mut self, m: &SkillMetrics) {
        let optional = [m.accuracy, m.state_error].map(|x| x.unwrap_or(0.0));
        let values = [m.loss, m.nll, m.kl, m.latent_norm, optional[0], m.grad_norm, optional[1]];
        self.count += 1;
        self.total.iter_mut().zip(values).for_each(|(sum, x)| *sum += f64::from(x));
    }

    /// Returns the means over those metrics that `last`, the last batch, has.
    pub(super) fn mean(self, last: &SkillMetrics) -> SkillMetrics {
        let [loss, nll, kl, latent_norm, hits, grad_norm, state_error] =
            self.total.map(|sum| (sum / self.count.max(1) as f64) as f32);
        let (accuracy, state_error) = (last.accuracy.map(|_| hits), last.state_error.map(|_| state_error));
        SkillMetrics { loss, nll, kl, latent_norm, accuracy, grad_norm, state_error, held_out: None }
    }
}

/// Returns the share of the actions that are the most likely ones; `None` for continuous actions.
pub(super) fn accuracy(decoded: &Dist, actions: &Actions) -> Result<Option<f32>, LearnError> {
    let (Dist::Categorical { log_probs }, Actions::Discrete(actions)) = (decoded, actions) else {
        return Ok(None);
    };
    let [rows, dim] = log_probs.dims();
    let log_probs = host(log_probs.clone().inner())?;
    let hits = log_probs.chunks_exact(dim).zip(actions).filter(|(row, a)| argmax(row) == **a).count();
    Ok(Some(hits as f32 / rows as f32))
}

//! Held-out demonstrations, which show when a skill model begins to overfit.

use super::{Dataset, SkillConfig, SkillMetrics, SkillNets, SkillTrainer, Window, skill_loss};
use crate::LearnError;
use crate::nn::{frozen, host, tracked};
use crate::rng::{Streams, shuffle};
use burn::tensor::Tensor;
use std::collections::BTreeSet;

/// Metrics of a skill model on held-out demonstrations: means over their windows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeldOutMetrics {
    /// The whole loss.
    pub loss: f32,
    /// Negative log-likelihood of a window's actions, in nats.
    pub nll: f32,
    /// KL from the encoder to the prior, in nats.
    pub kl: f32,
    /// As [`SkillMetrics::state_error`].
    pub state_error: Option<f32>,
}

/// Held-out demonstrations, with a fixed set of windows.
#[derive(Debug)]
pub(super) struct HeldOut {
    dataset: Dataset,
    windows: Vec<Window>,
}

/// The networks after the best epoch on the held-out demonstrations.
#[derive(Clone, Debug)]
pub(super) struct Best {
    /// Epochs done by then.
    pub(super) epoch: u64,
    /// The NLL on them.
    pub(super) nll: f32,
    pub(super) nets: SkillNets,
}

impl Dataset {
    /// Returns the episodes to learn from and the held-out ones: all episodes of a share of the levels, which is
    /// drawn from `streams`, at least one. Whole levels are held out because episodes of the same level are alike.
    ///
    /// # Errors
    /// [`LearnError::Config`] if no episode would be left to learn from.
    pub(super) fn without_held_out(
        self,
        config: &SkillConfig,
        streams: &Streams,
    ) -> Result<(Self, Option<HeldOut>), LearnError> {
        if config.held_out == 0.0 {
            return Ok((self, None));
        }
        let distinct: BTreeSet<usize> = self.levels.iter().copied().collect();
        // With a single level there are only episodes to choose from.
        let groups = if distinct.len() > 1 { self.levels.to_vec() } else { (0..self.episodes.len()).collect() };
        let mut order: Vec<usize> = groups.iter().copied().collect::<BTreeSet<_>>().into_iter().collect();
        let (all, what) = (order.len(), if distinct.len() > 1 { "levels" } else { "episodes" });
        let count = ((config.held_out * all as f64).round() as usize).max(1);
        if count >= all {
            let text = format!(
                "skill held_out takes {count} of {all} {what}, which leaves none to learn from: record more, or set \
                 it to 0"
            );
            return Err(LearnError::Config(text));
        }
        shuffle(&mut order, &mut streams.stream("skill.held_out", 0));
        let apart: BTreeSet<usize> = order[..count].iter().copied().collect();
        let some = |is_apart: bool| {
            let numbers = (0..groups.len()).filter(|&episode| apart.contains(&groups[episode]) == is_apart);
            self.subset(&numbers.collect::<Vec<_>>())
        };
        let dataset = some(true);
        let windows = dataset.windows(config.window, config.windows, streams, 0)?;
        Ok((some(false), Some(HeldOut { dataset, windows })))
    }
}

impl SkillTrainer {
    /// Measures the networks on the held-out demonstrations, if there are any, and keeps the networks if their NLL is
    /// the lowest so far. The rest of the loss does not count: it measures how skills are told apart, not how well
    /// they are played. The draws of skills are the same each time.
    pub(super) fn measure_held_out(&mut self) -> Result<Option<HeldOutMetrics>, LearnError> {
        let Some(held_out) = &self.held_out else { return Ok(None) };
        let mut sums = [0.0f64; 4];
        for (number, windows) in held_out.windows.chunks(self.config.batch).enumerate() {
            let mut rng = self.streams.stream("skill.held_out.noise", number as u64);
            let (forward, _) = self.forward_of(&held_out.dataset, windows, None, &mut rng)?;
            let loss = skill_loss(&forward, &self.config);
            let mut parts = vec![loss.total, loss.nll, loss.kl];
            parts.extend(self.state_error(&held_out.dataset, windows, &forward)?);
            let numbers = host(Tensor::cat(parts.into_iter().map(Tensor::inner).collect(), 0))?;
            sums.iter_mut().zip(numbers).for_each(|(sum, x)| *sum += f64::from(x) * windows.len() as f64);
        }
        let [loss, nll, kl, state_error] = sums.map(|sum| (sum / held_out.windows.len() as f64) as f32);
        if !loss.is_finite() {
            return Err(LearnError::NotFinite {
                tensor: "the loss on demonstrations kept apart".to_owned(),
                steps: None,
            });
        }
        if self.config.patience.is_some() && self.best.as_ref().is_none_or(|best| nll < best.nll) {
            let nets = SkillNets { state_heads: None, ..frozen(&self.nets) };
            self.best = Some(Best { epoch: self.epoch, nll, nets });
        }
        let state_error = self.nets.state_heads.as_ref().map(|_| state_error);
        Ok(Some(HeldOutMetrics { loss, nll, kl, state_error }))
    }

    /// Returns whether [`SkillConfig::patience`] is exhausted: more epochs would overfit.
    pub fn is_over(&self) -> bool {
        let best = self.best.as_ref().zip(self.config.patience);
        best.is_some_and(|(best, patience)| self.epoch >= best.epoch + patience as u64)
    }

    /// Returns the epoch after which the networks had the least NLL on the held-out demonstrations; `None` without
    /// any.
    pub fn best_epoch(&self) -> Option<u64> {
        self.best.as_ref().map(|best| best.epoch)
    }

    /// Returns the NLL on the held-out demonstrations after [`Self::best_epoch`].
    pub fn best_nll(&self) -> Option<f32> {
        self.best.as_ref().map(|best| best.nll)
    }

    /// Returns the networks of the model: the best ones, or the present ones.
    pub(super) fn nets_of_model(&self) -> SkillNets {
        self.best.as_ref().map_or_else(|| self.nets.clone(), |best| tracked(&best.nets))
    }
}

impl SkillMetrics {
    /// Returns the NLL on held-out demonstrations, if there are any.
    pub fn held_out_nll(&self) -> Option<f32> {
        self.held_out.map(|held_out| held_out.nll)
    }
}

//! Demonstrations that are kept apart, to see when a skill model begins to know the others by heart.

use super::{Dataset, SkillConfig, SkillMetrics, SkillNets, SkillTrainer, Window, skill_loss};
use crate::LearnError;
use crate::nn::{frozen, host, tracked};
use crate::rng::{Streams, shuffle};
use burn::tensor::Tensor;
use std::collections::BTreeSet;

/// What a skill model makes of demonstrations that it has not learned from: means over their windows.
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

/// Demonstrations that are not learned from, with the windows that are always cut from them.
#[derive(Debug)]
pub(super) struct HeldOut {
    dataset: Dataset,
    windows: Vec<Window>,
}

/// The networks after the epoch that was best on the demonstrations kept apart.
#[derive(Clone, Debug)]
pub(super) struct Best {
    /// Epochs done by then.
    pub(super) epoch: u64,
    /// The NLL on them.
    pub(super) nll: f32,
    pub(super) nets: SkillNets,
}

impl Dataset {
    /// The episodes to learn from and those to keep apart: all episodes of a share of the levels, which is drawn from `streams`,
    /// at least one. Episodes of the same level know much of each other, so that one learned from would tell of one kept apart.
    ///
    /// # Errors
    /// [`LearnError::Config`] if none would be left to learn from.
    pub(super) fn without_held_out(
        self,
        config: &SkillConfig,
        streams: &Streams,
    ) -> Result<(Self, Option<HeldOut>), LearnError> {
        if config.held_out == 0.0 {
            return Ok((self, None));
        }
        let distinct: BTreeSet<usize> = self.levels.iter().copied().collect();
        // Of a single level, episodes are all there is to choose from.
        let groups = if distinct.len() > 1 { self.levels.to_vec() } else { (0..self.episodes.len()).collect() };
        let mut order: Vec<usize> = groups.iter().copied().collect::<BTreeSet<_>>().into_iter().collect();
        let (all, what) = (order.len(), if distinct.len() > 1 { "levels" } else { "episodes" });
        let count = ((config.held_out * all as f64).round() as usize).max(1);
        if count >= all {
            let text = format!(
                "skill held_out keeps {count} of {all} {what} apart, so that none is left to learn from: record more, or set \
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
    /// What the networks make of the demonstrations kept apart, if there are any; remembers the networks if their NLL was never
    /// lower. The rest of the loss does not count: it says how skills are told apart, not how well they are played. The draws of
    /// skills are the same each time.
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

    /// Whether [`SkillConfig::patience`] is over: more epochs make it worse where it matters.
    pub fn is_over(&self) -> bool {
        let best = self.best.as_ref().zip(self.config.patience);
        best.is_some_and(|(best, patience)| self.epoch >= best.epoch + patience as u64)
    }

    /// After which epoch the networks had the least NLL on the demonstrations kept apart; `None` where nobody looks.
    pub fn best_epoch(&self) -> Option<u64> {
        self.best.as_ref().map(|best| best.epoch)
    }

    /// The NLL on the demonstrations kept apart after [`Self::best_epoch`].
    pub fn best_nll(&self) -> Option<f32> {
        self.best.as_ref().map(|best| best.nll)
    }

    /// The networks that the model gets: the best ones, or those there are now.
    pub(super) fn nets_of_model(&self) -> SkillNets {
        self.best.as_ref().map_or_else(|| self.nets.clone(), |best| tracked(&best.nets))
    }
}

impl SkillMetrics {
    /// The NLL on demonstrations kept apart, if there are any.
    pub fn held_out_nll(&self) -> Option<f32> {
        self.held_out.map(|held_out| held_out.nll)
    }
}

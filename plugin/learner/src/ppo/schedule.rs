//! The values that change from update to update, the learning rate and the penalty's weight, also in prolonged runs.

use crate::{learner::ContinuedSchedule, ppo::PpoConfig, score::ScoreConfig};
use serde::{Deserialize, Serialize};

/// The point at which a run got a new length, and its values in the update before. A run that is prolonged goes on
/// from them: the formulas of the whole length would make the values jump back.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TakenUp {
    /// Updates before it.
    update: u64,
    /// Learning rate.
    lr: f64,
    /// Weight of the penalty; `None` without a skill model.
    kl_coef: Option<f64>,
}

/// The schedules of a learner.
#[derive(Clone, Copy)]
pub(super) struct Schedule<'a> {
    pub(super) config: &'a PpoConfig,
    /// Settings of SCORE, with a skill model.
    pub(super) score: Option<&'a ScoreConfig>,
    pub(super) taken_up: Option<TakenUp>,
}

impl Schedule<'_> {
    /// Returns the learning rate of update number `update`, from 0.
    pub(super) fn lr(&self, update: u64) -> f64 {
        match self.taken_up {
            Some(begun) if self.config.anneal_lr => begun.lr * (1.0 - self.way(begun.update, update)),
            _ => self.config.lr_at(update),
        }
    }

    /// Returns the settings of SCORE with the penalty's weight in update number `update`, from 0.
    pub(super) fn score(&self, update: u64) -> Option<ScoreConfig> {
        let score = self.score?;
        let begun = self.taken_up.and_then(|begun| Some((begun.update, begun.kl_coef?, score.kl_coef_end?)));
        Some(match begun {
            Some((from, kl_coef, end)) => {
                ScoreConfig { kl_coef: kl_coef + self.way(from, update) * (end - kl_coef), ..score.clone() }
            }
            None => score.at(update, self.config.total_updates),
        })
    }

    /// Returns the share of the updates between `from` and the end of the run that are done at `update`.
    fn way(&self, from: u64, update: u64) -> f64 {
        let whole = self.config.total_updates.unwrap_or(0).saturating_sub(from).max(1);
        (update.saturating_sub(from) as f64 / whole as f64).min(1.0)
    }

    /// Returns the values of the last update, from which a run of another length goes on. `None` before the first
    /// update, or if the values do not change.
    pub(super) fn take_up(&self, updates: u64) -> Option<(TakenUp, ContinuedSchedule)> {
        let last = updates.checked_sub(1)?;
        let (lr, kl_coef) = (self.lr(last), self.score(last).map(|score| score.kl_coef));
        let continued = ContinuedSchedule {
            lr: self.config.anneal_lr.then_some(lr),
            kl_coef: kl_coef.zip(self.score.and_then(|score| score.kl_coef_end)),
        };
        let changes = continued.lr.is_some() || continued.kl_coef.is_some();
        changes.then_some((TakenUp { update: updates, lr, kl_coef }, continued))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(total: u64) -> PpoConfig {
        PpoConfig { lr: 0.5, anneal_lr: true, total_updates: Some(total), ..PpoConfig::default() }
    }

    #[test]
    fn a_prolonged_run_goes_on_from_its_last_values() {
        let score = ScoreConfig { kl_coef: 0.5, kl_coef_end: Some(0.0), ..ScoreConfig::default() };
        let (short, long) = (config(4), config(8));
        let first = Schedule { config: &short, score: Some(&score), taken_up: None };
        let (taken_up, continued) = first.take_up(4).expect("both change");
        // The fourth and last update had a quarter of both.
        assert_eq!(continued, ContinuedSchedule { lr: Some(0.125), kl_coef: Some((0.125, 0.0)) });
        let second = Schedule { config: &long, taken_up: Some(taken_up), ..first };
        assert_eq!([4, 6, 8, 9].map(|update| second.lr(update)), [0.125, 0.0625, 0.0, 0.0]);
        let kl_coef = |update| second.score(update).map(|score| score.kl_coef);
        assert_eq!([4, 6, 8].map(kl_coef), [Some(0.125), Some(0.0625), Some(0.0)]);
    }

    #[test]
    fn a_run_can_be_prolonged_twice() {
        let (short, long) = (config(4), config(8));
        let first = Schedule { config: &short, score: None, taken_up: None };
        let (taken_up, _) = first.take_up(2).expect("the rate falls");
        let second = Schedule { config: &long, taken_up: Some(taken_up), ..first };
        // 0.375 in the second update; it falls over the six that follow.
        assert_eq!([second.lr(2), second.lr(5)], [0.375, 0.1875]);
        let (again, _) = second.take_up(6).expect("the rate falls");
        let longest = config(12);
        let third = Schedule { config: &longest, taken_up: Some(again), ..first };
        assert_eq!(third.lr(6), second.lr(5));
        assert_eq!(third.lr(12), 0.0);
    }

    #[test]
    fn values_that_do_not_change_are_not_taken_up() {
        let (constant, falling) = (PpoConfig::default(), config(4));
        let score = ScoreConfig::default();
        assert_eq!(Schedule { config: &constant, score: Some(&score), taken_up: None }.take_up(3), None);
        assert_eq!(Schedule { config: &falling, score: None, taken_up: None }.take_up(0), None, "nothing was learned");
    }
}

//! Scaling of rewards by the spread of the discounted return.

use super::RunningStats;
use crate::LearnError;
use serde::{Deserialize, Serialize};

/// Added to the variance.
const EPS: f64 = 1e-8;
/// Bound to which scaled rewards are clipped.
const CLIP: f64 = 10.0;

/// The time at which the end of an episode resets its discounted return.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum RewardReset {
    /// After the last step: G = γ G + r, then G = 0 where the episode ended.
    #[default]
    AfterStep,
    /// In the last step, whose own reward then counts for the next episode: G = γ G (1 - done) + r (as some wrappers
    /// do; for comparison only).
    SameStep,
}

/// Divides rewards by the running standard deviation of the discounted return. No mean is subtracted.
///
/// Per step: G = γ G + r for every environment. The running variance takes in all G as one batch, and the reward
/// becomes clip(r/√(var + 1e-8), ±10). G of the environments whose episode ended is reset ([`RewardReset`]).
#[derive(Clone, Debug, PartialEq)]
pub struct RewardNormalizer {
    /// γ.
    pub gamma: f64,
    /// The time at which the end of an episode resets G.
    pub reset: RewardReset,
    /// The running variance, one dimension.
    pub stats: RunningStats,
    /// The discounted return of each environment; empty before the first batch.
    pub returns: Vec<f64>,
}

impl RewardNormalizer {
    /// Creates a normaliser without data.
    pub fn new(gamma: f64) -> Self {
        Self { gamma, reset: RewardReset::AfterStep, stats: RunningStats::new(1), returns: Vec::new() }
    }

    /// Adds and scales rewards `[T, envs]`, row-major; `done` marks the steps that ended an episode in any way.
    ///
    /// # Errors
    /// [`LearnError::Shape`] if `envs` differs from earlier calls, or the lengths differ or are no multiple of it;
    /// [`LearnError::Config`] if `envs` is 0. The state is unchanged then.
    pub fn normalize(&mut self, rewards: &[f32], done: &[bool], envs: usize) -> Result<Vec<f32>, LearnError> {
        let mut out = Vec::with_capacity(rewards.len());
        self.each_step(rewards, done, envs, |scaler, rewards| out.extend(rewards.iter().map(|&r| scaler.scale(r))))?;
        Ok(out)
    }

    /// Adds rewards as [`Self::normalize`] does, without scaling them: for learners that keep raw rewards and scale
    /// them when they read them ([`Self::scale`]).
    ///
    /// # Errors
    /// As [`Self::normalize`].
    pub fn update(&mut self, rewards: &[f32], done: &[bool], envs: usize) -> Result<(), LearnError> {
        self.each_step(rewards, done, envs, |_, _| {})
    }

    /// Does [`Self::update`] with separate episodes, such as recordings. The returns of the played episodes are
    /// unaffected, and the number of environments may differ.
    ///
    /// # Errors
    /// [`LearnError::Shape`] if the lengths differ or are no multiple of `envs`; [`LearnError::Config`] if that is 0.
    /// The state is unchanged then.
    pub fn update_apart(&mut self, rewards: &[f32], done: &[bool], envs: usize) -> Result<(), LearnError> {
        let mut others = Self { returns: Vec::new(), ..self.clone() };
        others.update(rewards, done, envs)?;
        self.stats = others.stats;
        Ok(())
    }

    /// Returns a reward scaled by the present variance: clip(r/√(var + 1e-8), ±10).
    pub fn scale(&self, reward: f32) -> f32 {
        let scale = 1.0 / (self.stats.var[0] + EPS).sqrt();
        (f64::from(reward) * scale).clamp(-CLIP, CLIP) as f32
    }

    /// Adds the rewards step by step and calls `seen` with each step's rewards after it was added.
    fn each_step(
        &mut self,
        rewards: &[f32],
        done: &[bool],
        envs: usize,
        mut seen: impl FnMut(&Self, &[f32]),
    ) -> Result<(), LearnError> {
        if envs == 0 {
            return Err(LearnError::Config("the reward normaliser needs at least one environment".to_owned()));
        }
        LearnError::check("episode ends", rewards.len(), done.len())?;
        LearnError::check("rewards of whole steps", rewards.len() / envs * envs, rewards.len())?;
        if self.returns.is_empty() {
            self.returns = vec![0.0; envs];
        }
        LearnError::check("environments of the reward normaliser", self.returns.len(), envs)?;
        for (rewards, done) in rewards.chunks_exact(envs).zip(done.chunks_exact(envs)) {
            for ((g, &r), &done) in self.returns.iter_mut().zip(rewards).zip(done) {
                let before = if done && self.reset == RewardReset::SameStep { 0.0 } else { *g };
                *g = self.gamma * before + f64::from(r);
            }
            self.stats.update(self.returns.iter().copied(), envs);
            seen(self, rewards);
            for (g, &done) in self.returns.iter_mut().zip(done) {
                if done && self.reset == RewardReset::AfterStep {
                    *g = 0.0;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn episodes_of_others_change_the_variance_and_no_return() {
        let mut normalizer = RewardNormalizer::new(0.5);
        normalizer.update(&[1.0, 2.0], &[false; 2], 2).expect("two environments");
        let (returns, mut both) = (normalizer.returns.clone(), normalizer.clone());
        normalizer.update_apart(&[4.0, 0.0], &[false, true], 1).expect("one other");
        // Returns of 4 and 2, which begin with nothing.
        [4.0, 2.0].iter().for_each(|g| both.stats.update(std::iter::once(*g), 1));
        assert_eq!((&normalizer.returns, &normalizer.stats), (&returns, &both.stats));
        assert!(normalizer.update_apart(&[1.0], &[], 1).is_err() && normalizer.stats == both.stats);
    }

    #[test]
    fn what_does_not_fit_is_refused_and_leaves_nothing_behind() {
        let mut normalizer = RewardNormalizer::new(0.9);
        let fresh = normalizer.clone();
        assert!(matches!(normalizer.normalize(&[], &[], 0), Err(LearnError::Config(_))));
        assert!(matches!(normalizer.update(&[1.0; 4], &[false; 3], 2), Err(LearnError::Shape { .. })));
        assert!(matches!(normalizer.update(&[1.0; 3], &[false; 3], 2), Err(LearnError::Shape { .. })));
        assert_eq!(normalizer, fresh);
        normalizer.update(&[1.0; 3], &[false; 3], 3).expect("three environments");
        let before = normalizer.clone();
        assert!(matches!(normalizer.update(&[1.0; 4], &[false; 4], 2), Err(LearnError::Shape { .. })));
        assert_eq!(normalizer, before);
    }
}

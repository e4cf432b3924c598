//! Normalisation of observations and rewards: running, and for observations also frozen.

use crate::{EntityBlock, FileError, LearnError, file::TensorFile};
use playbot_kernels::kept_memory::{OF_A_MOVE, share};
use serde::{Deserialize, Serialize};

/// Added to the variance.
const EPS: f64 = 1e-8;

/// Bound to which normalised observations are clipped.
const CLIP: f64 = 10.0;

/// Dimensions of running statistics that a thread takes at a time.
const DIMS: usize = 8;

/// Deviation below which a dimension counts as constant.
const CONSTANT: f64 = 1e-3;

/// Mean and scale per dimension, fixed.
#[derive(Clone, Debug, PartialEq)]
pub struct ObsStats {
    pub(crate) mean: Vec<f64>,
    pub(crate) inv_std: Vec<f64>,
}

impl ObsStats {
    /// Computes mean and deviation of all `rows` of `dim` numbers, the same on any number of threads.
    ///
    /// A dimension that deviates by less than 1e-3 counts as constant and is only centred, since its scale is
    /// unknown. A value that the rows do not hold keeps its distance from the mean.
    pub(crate) fn of<'a>(rows: impl Iterator<Item = &'a [f32]> + Clone, dim: usize) -> Self {
        let sums = |add: &dyn Fn(usize, f64) -> f64| {
            let (mut sums, mut n) = (vec![0.0; dim], 0u64);
            for row in rows.clone() {
                sums.iter_mut().zip(row).enumerate().for_each(|(d, (sum, &x))| *sum += add(d, f64::from(x)));
                n += 1;
            }
            sums.iter_mut().for_each(|sum| *sum /= n.max(1) as f64);
            sums
        };
        let mean = sums(&|_, x| x);
        let inv_std = sums(&|d, x| (x - mean[d]).powi(2)).iter().map(|var| inverse_deviation(*var)).collect();
        Self { mean, inv_std }
    }

    /// Computes them as [`Self::of`], with one mean and deviation for each number of a set's things, over those that are
    /// there. Presences stay as they are.
    pub(crate) fn tied<'a>(rows: impl Iterator<Item = &'a [f32]> + Clone, dim: usize, blocks: &[EntityBlock]) -> Self {
        let mut stats = Self::of(rows.clone(), dim);
        for block in blocks {
            let things = OfThings::of(rows.clone(), block);
            for (number, (mean, squares)) in things.numbers.into_iter().enumerate() {
                let scale = inverse_deviation(squares / things.count.max(1.0));
                block.each_slot(number, |place| (stats.mean[place], stats.inv_std[place]) = (mean, scale));
            }
            block.each_presence(|place| (stats.mean[place], stats.inv_std[place]) = (0.0, 1.0));
        }
        stats
    }

    /// Gives all things of a set the statistics of its first slot.
    #[must_use]
    pub(crate) fn shared(mut self, blocks: &[EntityBlock]) -> Self {
        for block in blocks {
            block.share(&mut self.mean);
            block.share(&mut self.inv_std);
        }
        self
    }

    /// Returns all of `rows` normalised.
    pub(crate) fn normalize(&self, rows: &[f32]) -> Vec<f32> {
        let (mut out, width) = (vec![0.0; rows.len()], self.mean.len().max(1));
        let pairs = rows.chunks_exact(width).zip(out.chunks_exact_mut(width));
        pairs.for_each(|(row, to)| self.normalize_into(row, to));
        out
    }

    /// Adds 1 to the count of each value that normalisation clips.
    pub(crate) fn count_clipped(&self, observation: &[f32], counts: &mut [usize]) {
        let dims = observation.iter().zip(&self.mean).zip(&self.inv_std);
        for (count, ((&x, m), s)) in counts.iter_mut().zip(dims) {
            *count += usize::from(((f64::from(x) - m) * s).abs() > CLIP);
        }
    }

    /// Writes the normalised `observation` to `out`, which is as long: clip((x - mean) / deviation, ±10).
    pub fn normalize_into(&self, observation: &[f32], out: &mut [f32]) {
        let dims = observation.iter().zip(&self.mean).zip(&self.inv_std);
        for (to, ((&x, m), s)) in out.iter_mut().zip(dims) {
            *to = ((f64::from(x) - m) * s).clamp(-CLIP, CLIP) as f32;
        }
    }
}

/// Returns 1/√var, or 1 for a nearly constant dimension.
fn inverse_deviation(var: f64) -> f64 {
    let deviation = var.sqrt();
    if deviation < CONSTANT { 1.0 } else { 1.0 / deviation }
}

/// Keeps the running mean and variance of observations.
#[derive(Clone, Debug, PartialEq)]
pub struct ObsNormalizer {
    /// Statistics of all observations so far.
    pub stats: RunningStats,
    /// Rows of each value, plus 1e-4, if some values came later than others; empty otherwise.
    pub(crate) counts: Vec<f64>,
    /// Sets whose things share their statistics. Only things that are there count, and presences are not normalised.
    blocks: Vec<EntityBlock>,
}

impl ObsNormalizer {
    /// Creates a normaliser without data.
    pub fn new(dim: usize) -> Self {
        Self { stats: RunningStats::new(dim), counts: Vec::new(), blocks: Vec::new() }
    }

    /// Ties the statistics of the things of these sets to each other, in a normaliser without data.
    #[must_use]
    pub(crate) fn tied(self, blocks: &[EntityBlock]) -> Self {
        let counts = if blocks.is_empty() { self.counts } else { vec![self.stats.count; self.stats.dim()] };
        Self { counts, blocks: blocks.to_vec(), ..self }
    }

    /// Creates a normaliser of statistics with the rows of each value. The things of a set get those of its first slot.
    pub(crate) fn of_parts(stats: RunningStats, counts: Vec<f64>, blocks: Vec<EntityBlock>) -> Self {
        let mut normalizer = Self { stats, counts, blocks };
        for block in &normalizer.blocks {
            block.share(&mut normalizer.stats.mean);
            block.share(&mut normalizer.stats.var);
            block.share(&mut normalizer.counts);
        }
        normalizer
    }

    /// Returns the sets whose things share their statistics.
    pub(crate) fn sets(&self) -> &[EntityBlock] {
        &self.blocks
    }

    /// Adds rows of observations.
    pub fn update(&mut self, rows: &[f32]) {
        if self.blocks.is_empty() {
            return self.stats.update_rows(rows, &mut self.counts);
        }
        let (before, counts) = (self.stats.clone(), self.counts.clone());
        self.stats.update_rows(rows, &mut self.counts);
        let width = self.stats.dim().max(1);
        for block in &self.blocks {
            let things = OfThings::of(rows.chunks_exact(width), block);
            for (number, batch) in things.numbers.into_iter().enumerate() {
                block.each_slot(number, |place| {
                    (self.stats.mean[place], self.stats.var[place]) = (before.mean[place], before.var[place]);
                    self.counts[place] = counts[place] + things.count;
                    if things.count > 0.0 {
                        self.stats.add_dim(place, batch, (counts[place], things.count));
                    }
                });
            }
            block.each_presence(|place| {
                (self.stats.mean[place], self.stats.var[place], self.counts[place]) = (0.0, 1.0, counts[place]);
            });
        }
    }

    /// Returns the present mean and scale 1/√(var + 1e-8). Presences in sets stay as they are.
    pub fn snapshot(&self) -> ObsStats {
        let mut inv_std: Vec<f64> = self.stats.var.iter().map(|v| 1.0 / (v + EPS).sqrt()).collect();
        self.blocks.iter().for_each(|block| block.each_presence(|place| inv_std[place] = 1.0));
        ObsStats { mean: self.stats.mean.clone(), inv_std }
    }
}

/// Mean and sum of squared deviations of each number of a set's things.
struct OfThings {
    count: f64,
    numbers: Vec<(f64, f64)>,
}

impl OfThings {
    /// Reads the things of all rows, each row's in their own order.
    fn of<'a>(rows: impl Iterator<Item = &'a [f32]> + Clone, block: &EntityBlock) -> Self {
        let (mut things, mut count, mut numbers) = (Vec::new(), 0.0, vec![(0.0, 0.0); block.width]);
        for row in rows.clone() {
            block.things(row, &mut things);
            for thing in &things {
                numbers.iter_mut().zip(*thing).for_each(|((sum, _), &x)| *sum += f64::from(x));
                count += 1.0;
            }
        }
        numbers.iter_mut().for_each(|(mean, _)| *mean /= f64::max(count, 1.0));
        for row in rows {
            block.things(row, &mut things);
            for thing in &things {
                numbers
                    .iter_mut()
                    .zip(*thing)
                    .for_each(|((mean, squares), &x)| *squares += (f64::from(x) - *mean).powi(2));
            }
        }
        Self { count, numbers }
    }
}

impl EntityBlock {
    /// Calls `visit` with the place of one number of each slot.
    fn each_slot(&self, number: usize, visit: impl FnMut(usize)) {
        (0..self.slots).map(|slot| self.start + slot * (self.width + 1) + 1 + number).for_each(visit);
    }

    /// Copies the numbers of the first slot to the others.
    fn share(&self, numbers: &mut [f64]) {
        let slots = &mut numbers[self.range()];
        (1..self.slots).for_each(|slot| slots.copy_within(..self.width + 1, slot * (self.width + 1)));
    }

    /// Calls `visit` with the place of each presence.
    fn each_presence(&self, visit: impl FnMut(usize)) {
        (0..self.slots).map(|slot| self.start + slot * (self.width + 1)).for_each(visit);
    }
}

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

/// Mean and variance of all rows so far, per dimension (Chan et al.'s parallel update).
///
/// Starts at mean 0, variance 1 and a count of 1e-4, which the first batch outweighs.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningStats {
    /// Mean per dimension.
    pub mean: Vec<f64>,
    /// Biased variance per dimension.
    pub var: Vec<f64>,
    /// Rows seen, plus 1e-4.
    pub count: f64,
}

impl RunningStats {
    /// Creates statistics without data.
    pub fn new(dim: usize) -> Self {
        Self { mean: vec![0.0; dim], var: vec![1.0; dim], count: 1e-4 }
    }

    /// Returns the number of dimensions.
    pub fn dim(&self) -> usize {
        self.mean.len()
    }

    /// Adds a batch of rows, row-major. Incomplete rows at the end are ignored.
    pub fn update(&mut self, rows: impl Iterator<Item = f64> + Clone, n: usize) {
        let dim = self.dim();
        if n == 0 || dim == 0 {
            return;
        }
        let count = n as f64;
        let mut mean = vec![0.0; dim];
        for (i, x) in rows.clone().take(n * dim).enumerate() {
            mean[i % dim] += x;
        }
        mean.iter_mut().for_each(|m| *m /= count);
        let mut squares = vec![0.0; dim];
        for (i, x) in rows.take(n * dim).enumerate() {
            squares[i % dim] += (x - mean[i % dim]).powi(2);
        }
        self.add(mean.into_iter().zip(squares), count);
    }

    /// Does [`Self::update`] for many rows, with threads that take a few dimensions each. `counts` are the rows of each
    /// dimension, if they differ.
    fn update_rows(&mut self, rows: &[f32], counts: &mut [f64]) {
        let dim = self.dim();
        let count = rows.len().checked_div(dim).unwrap_or_default() as f64;
        if count == 0.0 {
            return;
        }
        let mut batch = vec![(0.0, 0.0); dim];
        share(&mut batch, DIMS, 2 * rows.len() * OF_A_MOVE, |piece, batch| {
            let parts = || rows.chunks_exact(dim).map(|row| &row[piece * DIMS..]);
            for part in parts() {
                batch.iter_mut().zip(part).for_each(|((mean, _), &x)| *mean += f64::from(x));
            }
            batch.iter_mut().for_each(|(mean, _)| *mean /= count);
            for part in parts() {
                let pairs = batch.iter_mut().zip(part);
                pairs.for_each(|((mean, squares), &x)| *squares += (f64::from(x) - *mean).powi(2));
            }
        });
        if counts.is_empty() {
            return self.add(batch.into_iter(), count);
        }
        let before = self.count;
        for (d, (of_dim, batch)) in counts.iter_mut().zip(batch).enumerate() {
            self.add_dim(d, batch, (*of_dim, count));
            *of_dim += count;
        }
        self.count = before + count;
    }

    /// Adds a batch of `count` rows, by the mean and the sum of squared deviations of each dimension.
    fn add(&mut self, batch: impl Iterator<Item = (f64, f64)>, count: f64) {
        for (d, batch) in batch.enumerate() {
            self.add_dim(d, batch, (self.count, count));
        }
        self.count += count;
    }

    /// Adds the mean and the sum of squared deviations of `count` rows to a dimension that had `before`.
    fn add_dim(&mut self, d: usize, (mean, squares): (f64, f64), (before, count): (f64, f64)) {
        let total = before + count;
        let delta = mean - self.mean[d];
        let spread = squares + self.var[d] * before + delta * delta * before * count / total;
        self.mean[d] += delta * count / total;
        self.var[d] = spread / total;
    }
}

// Normalisers in files.

/// Adds the state of a learner's normalisers to a file.
pub(crate) fn put_normalizers(
    file: &mut TensorFile,
    observations: Option<&ObsNormalizer>,
    rewards: Option<&RewardNormalizer>,
) {
    if let Some(normalizer) = observations {
        put_stats(file, "obs_norm", &normalizer.stats);
        if !normalizer.counts.is_empty() {
            file.put_f64("obs_norm.counts", &normalizer.counts);
        }
    }
    if let Some(normalizer) = rewards {
        put_stats(file, "reward_norm", &normalizer.stats);
        file.put_f64("reward_norm.returns", &normalizer.returns);
    }
}

/// Takes the state of a learner's normalisers out of a file.
pub(crate) fn take_normalizers(
    file: &mut TensorFile,
    observations: Option<&mut ObsNormalizer>,
    rewards: Option<&mut RewardNormalizer>,
) -> Result<(), FileError> {
    if let Some(normalizer) = observations {
        take_stats(file, "obs_norm", &mut normalizer.stats)?;
        if file.has("obs_norm.counts") {
            normalizer.counts = file.take_f64("obs_norm.counts", Some(normalizer.stats.dim()))?;
        }
    }
    if let Some(normalizer) = rewards {
        take_stats(file, "reward_norm", &mut normalizer.stats)?;
        normalizer.returns = file.take_f64("reward_norm.returns", None)?;
    }
    Ok(())
}

/// Adds frozen statistics called `name` to a file.
pub(crate) fn put_obs_stats(file: &mut TensorFile, name: &str, stats: &ObsStats) {
    file.put_f64(&format!("{name}.mean"), &stats.mean);
    file.put_f64(&format!("{name}.inv_std"), &stats.inv_std);
}

/// Takes the frozen statistics of `dim` numbers called `name` out of a file.
pub(crate) fn take_obs_stats(file: &mut TensorFile, name: &str, dim: usize) -> Result<ObsStats, FileError> {
    let mean = file.take_f64(&format!("{name}.mean"), Some(dim))?;
    let inv_std = file.take_f64(&format!("{name}.inv_std"), Some(dim))?;
    let usable = |(mean, scale): (&f64, &f64)| mean.is_finite() && scale.is_finite() && *scale > 0.0;
    match mean.iter().zip(&inv_std).position(|pair| !usable(pair)) {
        None => Ok(ObsStats { mean, inv_std }),
        Some(at) => {
            let text = format!("`{name}` cannot normalise number {at}: {} · (x - {})", inv_std[at], mean[at]);
            Err(file.format(text))
        }
    }
}

/// Adds running statistics called `name` to a file.
pub(crate) fn put_stats(file: &mut TensorFile, name: &str, stats: &RunningStats) {
    file.put_f64(&format!("{name}.mean"), &stats.mean);
    file.put_f64(&format!("{name}.var"), &stats.var);
    file.put_f64(&format!("{name}.count"), &[stats.count]);
}

/// Takes the running statistics called `name` out of a file.
pub(crate) fn take_stats(file: &mut TensorFile, name: &str, stats: &mut RunningStats) -> Result<(), FileError> {
    let dim = stats.dim();
    stats.mean = file.take_f64(&format!("{name}.mean"), Some(dim))?;
    stats.var = file.take_f64(&format!("{name}.var"), Some(dim))?;
    stats.count = file.take_f64(&format!("{name}.count"), Some(1))?[0];
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frozen_statistics_by_hand() {
        // The second dimension is constant, the third nearly so.
        let rows = [[1.0, 60.0, 0.5], [5.0, 60.0, 0.5002], [3.0, 60.0, 0.5001], [7.0, 60.0, 0.4997]];
        let stats = ObsStats::of(rows.iter().map(<[f32; 3]>::as_slice), 3);
        let got = stats.normalize(&[6.0, 60.0, 0.5, -400.0, 63.0, 1.5]);
        // Mean 4, variance 5.
        let want = [2.0 / 5.0f32.sqrt(), 0.0, 0.0, -10.0, 3.0, 1.0];
        assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() < 1e-4), "{got:?}, expected {want:?}");
        assert_eq!(ObsStats::of(std::iter::empty(), 2).normalize(&[3.0, -4.0]), [3.0, -4.0]);
    }

    #[test]
    fn many_rows_are_added_as_their_numbers_one_by_one() {
        let (dim, mut rng) = (19, crate::rng::Streams::new(1).stream("rows", 0));
        let rows: Vec<f32> = (0..dim * 3000 + 5).map(|_| 3.0 + crate::rng::normal(&mut rng)).collect();
        let mut one_by_one = RunningStats::new(dim);
        one_by_one.update(rows.iter().map(|&x| f64::from(x)), 3000);
        for threads in [1, 3] {
            let mut normalizer = ObsNormalizer::new(dim);
            crate::Workers::new(threads).bound(|| crate::among_awake_workers(|| normalizer.update(&rows)));
            assert_eq!(normalizer.stats, one_by_one, "on {threads} threads");
            normalizer.update(&[1.0; 18]);
            assert_eq!(normalizer.stats, one_by_one, "no whole row");
        }
        let mut empty = ObsNormalizer::new(0);
        empty.update(&[]);
        assert_eq!(empty.stats, RunningStats::new(0));
    }

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

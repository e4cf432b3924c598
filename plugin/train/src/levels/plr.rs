//! Prioritised level replay: scores of levels, and the levels that are played next.
//!
//! Jiang, Grefenstette and Rocktäschel 2021, "Prioritized Level Replay". The score of a level is the mean size of the
//! advantages of its last episode. Its probability is a mixture of its rank by that score and of its staleness:
//!
//! P = (1 − ρ) P_S + ρ P_C, with P_S ∝ (1 / rank)^(1/β) and P_C ∝ c − C.
//!
//! c counts the episodes that have ended, and C is c when the level's last one had ended. Scores and counts change
//! between rollouts only. Within a rollout each arena draws from the same probabilities with its own random stream, so
//! the draws do not depend on the number of threads.

use bevy_playbot::level::WeightedLevels;
use playbot_harness::split::LevelSplit;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Settings of the replay: β, ρ and the probability of a new level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlrSettings {
    /// β, above 0.
    pub temperature: f64,
    /// ρ, 0 to 1.
    pub staleness: f64,
    /// Probability of a level that was not played yet, while there are any.
    pub new: f64,
}

/// What is known of a played level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct LevelScore {
    level: u64,
    /// Mean size of the advantages of its last episode.
    score: f64,
    /// The count of ended episodes when its last one had ended.
    played: u64,
}

/// The played levels of a lesson, with their scores.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct LevelScores {
    /// Episodes that have ended.
    episodes: u64,
    /// Played levels, ascending.
    levels: Vec<LevelScore>,
}

impl LevelScores {
    /// Notes an episode that has ended, with the mean size of its advantages. Without any, the level keeps its score.
    pub(super) fn note(&mut self, level: u64, mean: Option<f64>) {
        self.episodes += 1;
        let played = self.episodes;
        match self.levels.binary_search_by_key(&level, |known| known.level) {
            Ok(at) => {
                let known = &mut self.levels[at];
                (known.score, known.played) = (mean.unwrap_or(known.score), played);
            }
            Err(at) => self.levels.insert(at, LevelScore { level, score: mean.unwrap_or(0.0), played }),
        }
    }

    /// Returns the probabilities of the played levels, in their order, which add up to 1.
    pub(super) fn probabilities(&self, settings: PlrSettings) -> Vec<f64> {
        let count = self.levels.len();
        let mut by_score: Vec<usize> = (0..count).collect();
        // Equal scores keep the order of their levels.
        by_score.sort_by(|a, b| self.levels[*b].score.total_cmp(&self.levels[*a].score));
        let mut of_ranks = vec![0.0; count];
        for (rank, level) in by_score.into_iter().enumerate() {
            of_ranks[level] = libm::pow(1.0 / (rank + 1) as f64, 1.0 / settings.temperature);
        }
        let mut of_ages: Vec<f64> = self.levels.iter().map(|known| (self.episodes - known.played) as f64).collect();
        if of_ages.iter().all(|age| *age == 0.0) {
            of_ages.fill(1.0);
        }
        let (ranks, ages): (f64, f64) = (of_ranks.iter().sum(), of_ages.iter().sum());
        let mix = |(rank, age): (f64, f64)| (1.0 - settings.staleness) * rank / ranks + settings.staleness * age / ages;
        of_ranks.into_iter().zip(of_ages).map(mix).collect()
    }

    /// Returns the queue of the next rollout.
    pub(super) fn queue(&self, lesson: &LevelSplit, settings: PlrSettings) -> WeightedLevels {
        let levels = self.levels.iter().map(|known| known.level);
        let weights = levels.zip(self.probabilities(settings));
        WeightedLevels::new(lesson.first, lesson.last, weights, settings.new)
    }

    /// Returns the metrics: levels that were played, their scores, and the number of equally likely levels whose
    /// entropy is that of the probabilities.
    pub(super) fn scalars(&self, settings: PlrSettings) -> Vec<(&'static str, f64)> {
        let mut scalars = vec![("levels/played", self.levels.len() as f64)];
        if self.levels.is_empty() {
            return scalars;
        }
        let scores = || self.levels.iter().map(|known| known.score);
        let entropy: f64 = self.probabilities(settings).iter().filter(|p| **p > 0.0).map(|p| -p * libm::log(*p)).sum();
        scalars.push(("levels/score_mean", scores().sum::<f64>() / self.levels.len() as f64));
        scalars.push(("levels/score_max", scores().fold(0.0, f64::max)));
        scalars.push(("levels/effective", libm::exp(entropy)));
        scalars
    }
}

/// The advantages of the episodes that still run, by arena.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct RunningMeans(Vec<RunningMean>);

/// A mean that is not complete.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct RunningMean {
    sum: f64,
    count: u64,
}

/// An agent and a tick of a rollout, in which an episode has ended, with the mean size of its advantages. There is no mean
/// if no advantage was estimated in the episode.
pub(super) type MeansOfEnds = BTreeMap<(usize, usize), Option<f64>>;

impl RunningMeans {
    /// Adds the advantages of a rollout, `[ticks, agents]`, and returns the means of the episodes that ended in it, by
    /// agent and tick. Parts of an episode in earlier rollouts count as they were estimated then.
    pub(super) fn add(&mut self, sizes: &[Option<f32>], ends: &[bool], agents: usize) -> MeansOfEnds {
        self.0.resize(agents, RunningMean::default());
        let mut means = MeansOfEnds::new();
        for (row, (size, is_end)) in sizes.iter().zip(ends).enumerate() {
            let (tick, agent) = (row / agents.max(1), row % agents.max(1));
            let running = &mut self.0[agent];
            if let Some(size) = size {
                running.sum += f64::from(*size);
                running.count += 1;
            }
            if *is_end {
                let mean = (running.count > 0).then(|| running.sum / running.count as f64);
                means.insert((agent, tick), mean);
                *running = RunningMean::default();
            }
        }
        means
    }

    /// Forgets the episodes that still run, for arenas that begin others.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: PlrSettings = PlrSettings { temperature: 0.5, staleness: 0.25, new: 0.5 };

    /// Four episodes on three levels: 7, 5, 9 and 7 again.
    fn scores() -> LevelScores {
        let mut scores = LevelScores::default();
        for (level, mean) in [(7, 9.0), (5, 0.5), (9, 2.0), (7, 1.0)] {
            scores.note(level, Some(mean));
        }
        scores
    }

    #[test]
    fn probabilities_are_those_worked_out_by_hand() {
        // Scores of the levels 5, 7 and 9 are 0.5, 1 and 2, so their ranks are 3, 2 and 1. With β = 1/2 their weights are
        // 1/9, 1/4 and 1, of a sum of 49/36: P_S = 4/49, 9/49, 36/49. Their last episodes were the 2nd, 4th and 3rd of 4,
        // so their ages are 2, 0 and 1: P_C = 2/3, 0, 1/3. P = 3/4 P_S + 1/4 P_C.
        let expected = [12.0 / 196.0 + 2.0 / 12.0, 27.0 / 196.0, 108.0 / 196.0 + 1.0 / 12.0];
        let found = scores().probabilities(SETTINGS);
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-15, "{found} is not {expected}");
        }
        assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn scores_alone_and_ages_alone_are_the_ends_of_the_mixture() {
        let of = |staleness| scores().probabilities(PlrSettings { staleness, ..SETTINGS });
        let close = |found: Vec<f64>, expected: [f64; 3]| {
            found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-15)
        };
        assert!(close(of(0.0), [4.0 / 49.0, 9.0 / 49.0, 36.0 / 49.0]));
        assert!(close(of(1.0), [2.0 / 3.0, 0.0, 1.0 / 3.0]));
        let mut one = LevelScores::default();
        one.note(3, Some(0.0));
        assert_eq!(one.probabilities(PlrSettings { staleness: 1.0, ..SETTINGS }), [1.0], "it is not stale");
    }

    #[test]
    fn a_low_temperature_prefers_the_highest_score() {
        let cold = scores().probabilities(PlrSettings { temperature: 0.01, staleness: 0.0, new: 0.0 });
        assert!(cold[2] > 0.999_999, "{cold:?}");
        let hot = scores().probabilities(PlrSettings { temperature: 1e6, staleness: 0.0, new: 0.0 });
        assert!(hot.iter().all(|p| (p - 1.0 / 3.0).abs() < 1e-5), "{hot:?}");
    }

    #[test]
    fn equal_scores_rank_in_the_order_of_their_levels() {
        let mut scores = LevelScores::default();
        for level in [4, 2] {
            scores.note(level, Some(1.0));
        }
        // Ranks 1 and 2, with weights 1 and 1/4.
        assert_eq!(scores.probabilities(PlrSettings { staleness: 0.0, ..SETTINGS }), [0.8, 0.2]);
    }

    #[test]
    fn metrics_say_how_many_levels_are_in_play() {
        let scores = scores();
        let scalars: BTreeMap<_, _> = scores.scalars(PlrSettings { staleness: 0.0, ..SETTINGS }).into_iter().collect();
        // Entropy of 4/49, 9/49 and 36/49 in nats.
        let entropy = [4.0, 9.0, 36.0].map(|n: f64| -(n / 49.0) * libm::log(n / 49.0)).iter().sum::<f64>();
        assert_eq!((scalars["levels/played"], scalars["levels/score_max"]), (3.0, 2.0));
        assert!((scalars["levels/score_mean"] - 3.5 / 3.0).abs() < 1e-15);
        assert!((scalars["levels/effective"] - libm::exp(entropy)).abs() < 1e-12);
        assert_eq!(LevelScores::default().scalars(SETTINGS), [("levels/played", 0.0)]);
    }

    #[test]
    fn means_are_those_of_whole_episodes_over_rollouts() {
        // Two agents. The first ends after two ticks, and again in the next rollout; the second not before that.
        let mut running = RunningMeans::default();
        let sizes = |values: [f32; 6]| values.map(Some);
        let ends = [false, false, true, false, false, false];
        let means = running.add(&sizes([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), &ends, 2);
        assert_eq!(means, MeansOfEnds::from([((0, 1), Some(2.0))]));
        let ends = [true, false, false, true, false, false];
        let means = running.add(&sizes([7.0, 8.0, 0.0, 10.0, 0.0, 0.0]), &ends, 2);
        assert_eq!(means, MeansOfEnds::from([((0, 0), Some(6.0)), ((1, 1), Some(6.0))]));
    }

    #[test]
    fn rows_without_a_decision_do_not_count() {
        let mut running = RunningMeans::default();
        let means = running.add(&[Some(4.0), None, None, Some(2.0)], &[false, true, true, true], 1);
        assert_eq!(means, MeansOfEnds::from([((0, 1), Some(4.0)), ((0, 2), None), ((0, 3), Some(2.0))]));
        let mut scores = scores();
        scores.note(5, None);
        scores.note(6, None);
        let kept: Vec<_> = scores.levels.iter().map(|known| (known.level, known.score, known.played)).collect();
        assert_eq!(kept, [(5, 0.5, 5), (6, 0.0, 6), (7, 1.0, 4), (9, 2.0, 3)]);
    }
}

//! Summaries of evaluated episodes.

use std::collections::BTreeMap;

use bevy_playbot::episode::EpisodeResult;
use serde::Serialize;

use crate::split::LevelSplit;

/// The summary of an evaluation: one row of a result table.
///
/// Standard errors estimate the distance of the means from those of all levels like these, see [`error_over_levels`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EvalSummary {
    /// Name of the player.
    pub method: String,
    /// Levels, as `mode:first..last`.
    pub split: String,
    /// Levels that were played.
    pub levels: u64,
    /// Episodes.
    pub episodes: u64,
    /// Mean return.
    pub return_mean: f64,
    /// Its standard error, over levels.
    pub return_se: f64,
    /// Share of episodes that reached the level's goal.
    pub success: f64,
    /// Its standard error, over levels.
    pub success_se: f64,
    /// Mean length, ticks.
    pub length_mean: f64,
    /// Share of all ticks whose action was clipped to the game's range.
    pub clipped: f64,
    /// Mean return on each level, in ascending order of levels, for comparisons level by level. It is not part of a
    /// table's JSON.
    #[serde(skip)]
    pub level_returns: Vec<f64>,
}

/// Summarises the episodes of one player on one split.
pub fn summarize(method: &str, split: &LevelSplit, results: &[EpisodeResult]) -> EvalSummary {
    let by_level = |value: fn(&EpisodeResult) -> f64| -> Vec<(u64, f64)> {
        results.iter().map(|result| (result.level, value(result))).collect()
    };
    let returns = by_level(|result| result.total_reward);
    let successes = by_level(|result| f64::from(u8::from(result.success)));
    let lengths = by_level(|result| f64::from(result.ticks));
    let clipped = by_level(|result| f64::from(result.clipped));
    let level_returns = means_of_levels(&returns);
    EvalSummary {
        method: method.to_owned(),
        split: split.to_string(),
        levels: level_returns.len() as u64,
        episodes: results.len() as u64,
        return_mean: mean(&returns),
        return_se: error_over_levels(&returns),
        success: mean(&successes),
        success_se: error_over_levels(&successes),
        length_mean: mean(&lengths),
        clipped: mean(&clipped) / mean(&lengths).max(1.0),
        level_returns,
    }
}

/// Returns the standard error of the mean of values that come in clusters, the levels: s / √L, with s the sample
/// standard deviation of the L level means.
///
/// Episodes of one level are alike, and those of a player without randomness are equal. Repeats of a level say nothing
/// about other levels, so they must not reduce the error. Every level counts as if it had equally many values. With a
/// single level the error is that over its episodes, and 0 for a single episode.
pub fn error_over_levels(values: &[(u64, f64)]) -> f64 {
    match &means_of_levels(values)[..] {
        [_] => standard_error(&values.iter().map(|(_, value)| *value).collect::<Vec<_>>()),
        levels => standard_error(levels),
    }
}

fn means_of_levels(values: &[(u64, f64)]) -> Vec<f64> {
    let mut levels: BTreeMap<u64, (f64, f64)> = BTreeMap::new();
    for (level, value) in values {
        let (sum, count) = levels.entry(*level).or_default();
        (*sum, *count) = (*sum + value, *count + 1.0);
    }
    levels.into_values().map(|(sum, count)| sum / count).collect()
}

fn mean(values: &[(u64, f64)]) -> f64 {
    values.iter().map(|(_, value)| value).sum::<f64>() / values.len() as f64
}

fn standard_error(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return 0.0;
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (squares / (n - 1.0) / n).sqrt()
}

#[cfg(test)]
mod tests {
    use bevy_playbot::episode::EpisodeEnd;

    use super::*;

    /// Levels 0, 1 and 2 with the returns 0, 3 and 6, each repeated `times` times.
    fn repeated(times: usize) -> Vec<(u64, f64)> {
        [(0, 0.0), (1, 3.0), (2, 6.0)].into_iter().flat_map(|value| std::iter::repeat_n(value, times)).collect()
    }

    #[test]
    fn repeats_of_a_level_do_not_make_the_error_smaller() {
        // Deviations from 3: -3, 0, 3; squares 18 over n - 1 = 2 and n = 3.
        assert_eq!(error_over_levels(&repeated(1)), 3f64.sqrt());
        assert_eq!(error_over_levels(&repeated(16)), 3f64.sqrt());
    }

    #[test]
    fn what_differs_within_a_level_counts_by_its_mean() {
        let values = [(7, 1.0), (3, 4.0), (7, 3.0), (3, 6.0)];
        // Level means 5 and 2: squares 4.5 over n - 1 = 1 and n = 2.
        assert_eq!(error_over_levels(&values), 1.5);
    }

    #[test]
    fn a_single_level_has_the_error_of_its_episodes() {
        assert_eq!(error_over_levels(&[(5, 1.0), (5, 3.0)]), 1.0);
        assert_eq!(error_over_levels(&[(5, 1.0)]), 0.0);
        assert_eq!(error_over_levels(&[]), 0.0);
    }

    #[test]
    fn a_summary_counts_levels_and_episodes() {
        let split: LevelSplit = "plain:0..1".parse().expect("valid");
        let end = EpisodeEnd::LOST;
        let result =
            |level, success, total_reward| EpisodeResult { level, end, success, ticks: 10, clipped: 1, total_reward };
        let results = [result(0, true, 2.0), result(0, true, 2.0), result(1, false, 0.0), result(1, true, 0.0)];
        let summary = summarize("bot", &split, &results);
        assert_eq!((summary.levels, summary.episodes), (2, 4));
        assert_eq!((summary.return_mean, summary.return_se), (1.0, 1.0));
        assert_eq!((summary.success, summary.success_se), (0.75, 0.25));
        assert_eq!((summary.length_mean, summary.clipped), (10.0, 0.1));
    }
}

//! Results of methods as rows, and their ranks.

use crate::statistics::PairedDifference;
use serde::{Deserialize, Deserializer, Serialize};

/// A table of results.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResultTable {
    /// Caption of the table.
    pub caption: String,
    /// The results, in the order they are shown.
    pub rows: Vec<ResultRow>,
    /// Figures from other sources, such as a paper, shown below for comparison. They are not ranked.
    pub references: Vec<ResultRow>,
}

/// Results of one method on one set of levels. NaN stands for an unknown value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResultRow {
    /// The method: "SCORE-PPO", "PPO", "random", …
    pub method: String,
    /// The levels: "train", "held-out", …
    pub split: String,
    /// Number of episodes; 0 when not known.
    pub episodes: usize,
    /// Mean of the undiscounted returns.
    #[serde(deserialize_with = "null_is_nan")]
    pub return_mean: f64,
    /// Standard error of that mean, over levels.
    #[serde(deserialize_with = "null_is_nan")]
    pub return_se: f64,
    /// Mean return on each level, in ascending order of levels; empty where it is not known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub level_returns: Vec<f64>,
    /// Share of the episodes that succeeded, 0 to 1.
    #[serde(deserialize_with = "null_is_nan")]
    pub success: f64,
    /// Mean number of ticks of an episode.
    #[serde(deserialize_with = "null_is_nan")]
    pub length_mean: f64,
    /// Environment steps per second of wall-clock time, if measured.
    pub steps_per_s: Option<f64>,
}

/// Reads null as NaN, which JSON lacks.
fn null_is_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// Rank of a row within its split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rank {
    /// The highest mean return.
    Best,
    /// Below the best, by less than two [standard errors of the difference](error_of_difference).
    CloseToBest,
    /// Clearly below the best, or without a row to compare with.
    Other,
}

/// Ranks the rows within each split, by mean return. A row alone in its split is not ranked best.
pub(crate) fn ranks(rows: &[ResultRow]) -> Vec<Rank> {
    let rank = |row: &ResultRow| {
        let rivals = || rows.iter().filter(|r| r.split == row.split && !r.return_mean.is_nan());
        let best = rivals().max_by(|a, b| a.return_mean.total_cmp(&b.return_mean))?;
        if rivals().count() < 2 || row.return_mean.is_nan() {
            return None;
        }
        let behind = best.return_mean - row.return_mean;
        if behind <= 0.0 {
            Some(Rank::Best)
        } else if behind < 2.0 * error_of_difference(best, row) {
            Some(Rank::CloseToBest)
        } else {
            None
        }
    };
    rows.iter().map(|row| rank(row).unwrap_or(Rank::Other)).collect()
}

/// Returns the standard error of the difference of two mean returns. It is paired over levels, since hard levels are
/// hard for both. If the returns on the levels are unknown, the means count as independent.
fn error_of_difference(one: &ResultRow, other: &ResultRow) -> f64 {
    let in_pairs = PairedDifference::of(&[&one.level_returns], &[&other.level_returns]);
    // A single level shows no variation over levels.
    let in_pairs = in_pairs.filter(|difference| difference.levels > 1);
    in_pairs.map_or_else(|| libm::hypot(one.return_se, other.return_se), |difference| difference.se)
}

/// Returns the key to the signs of [`Rank`] that occur.
pub(crate) fn rank_key(ranks: &[Rank], best: &str, close: &str) -> Option<String> {
    if !ranks.contains(&Rank::Best) {
        return None;
    }
    let mut key = format!("{best} highest mean return of its split");
    if ranks.contains(&Rank::CloseToBest) {
        key += &format!("; {close} within two standard errors of the difference to it");
    }
    Some(key)
}

#[cfg(test)]
pub(crate) fn sample_rows() -> Vec<ResultRow> {
    let row = |method: &str, split: &str, return_mean, return_se, success, steps_per_s| ResultRow {
        method: method.into(),
        split: split.into(),
        episodes: 500,
        return_mean,
        return_se,
        level_returns: Vec::new(),
        success,
        length_mean: 83.25,
        steps_per_s,
    };
    vec![
        row("SCORE-PPO", "train", 9.61, 0.08, 0.961, Some(12_345.6)),
        row("PPO", "train", 9.52, 0.09, 0.952, Some(15_001.0)),
        row("SCORE-PPO", "held-out", 9.14, 0.11, 0.914, None),
        row("PPO", "held-out", 7.40, 0.19, 0.74, None),
        row("random", "held-out", -0.31, 0.14, 0.02, None),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_is_best_within_its_split() {
        use Rank::*;
        assert_eq!(ranks(&sample_rows()), [Best, CloseToBest, Best, Other, Other]);
        assert_eq!(ranks(&sample_rows()[..1]), [Other], "alone");
        let mut rows = sample_rows();
        rows[0].return_mean = f64::NAN;
        assert_eq!(ranks(&rows)[..2], [Other, Other]);
        rows[0].return_mean = rows[1].return_mean;
        assert_eq!(ranks(&rows)[..2], [Best, Best], "a tie");
        assert_eq!(ranks(&[]), []);
    }

    #[test]
    fn what_levels_do_to_both_is_no_noise() {
        use Rank::*;
        let mut rows = sample_rows();
        rows.truncate(2);
        let [levels, behind] = [[0.0, 9.0, 1.0, 10.0], [0.01, 0.02, 0.01, 0.02]];
        rows[0].level_returns = levels.to_vec();
        rows[1].level_returns = levels.iter().zip(behind).map(|(level, behind)| level - behind).collect();
        (rows[0].return_mean, rows[1].return_mean) = (5.0, 4.985);
        assert_eq!(ranks(&rows), [Best, Other], "behind on every level, by little");
        rows[1].level_returns = vec![1.0, 8.0, 0.0, 10.94];
        assert_eq!(ranks(&rows), [Best, CloseToBest], "now before, now behind");
        rows[1].level_returns.pop();
        assert_eq!(ranks(&rows), [Best, CloseToBest], "of other levels: each with its own error");
    }

    #[test]
    fn unknown_values_survive_json() {
        let mut row = sample_rows().remove(0);
        row.success = f64::NAN;
        let json = serde_json::to_string(&row).expect("serialises");
        assert!(json.contains("\"success\":null"), "{json}");
        let back: ResultRow = serde_json::from_str(&json).expect("reads back");
        assert!(back.success.is_nan() && back.return_mean == row.return_mean);
    }
}

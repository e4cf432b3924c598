//! Numbers for people: axis labels, table cells.

use crate::statistics::PairedDifference;
use serde::{Deserialize, Deserializer, Serialize};

/// Sign for an unknown value.
pub const UNKNOWN: &str = "–";

/// Formats `value` with a fixed number of decimals, a real minus sign and thousands separated; NaN is unknown.
pub fn fixed(value: f64, decimals: usize) -> String {
    if value.is_nan() {
        return UNKNOWN.to_owned();
    }
    if value.abs() >= 1e15 {
        return format!("{value:.2e}").replace('-', "−");
    }
    let text = format!("{:.decimals$}", value.abs());
    let (whole, fraction) = match text.split_once('.') {
        Some((whole, fraction)) => (whole, format!(".{fraction}")),
        None => (text.as_str(), String::new()),
    };
    let mut out = String::new();
    // A value that rounds to zero has no sign.
    if value < 0.0 && text.chars().any(|c| ('1'..='9').contains(&c)) {
        out.push('−');
    }
    for (i, digit) in whole.chars().enumerate() {
        if i > 0 && (whole.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out + &fraction
}

/// Formats `value` without decimals, for counts; NaN is unknown.
pub fn whole(value: f64) -> String {
    fixed(value, 0)
}

/// Formats ticks: without decimals if whole, since medians and quartiles may lie between two ticks; NaN is unknown.
pub fn ticks(value: f64) -> String {
    if value.fract() == 0.0 { whole(value) } else { fixed(value, 1) }
}

/// Formats a count as `once` or `3 times`.
pub fn times(count: u32) -> String {
    if count == 1 { "once".to_owned() } else { format!("{count} times") }
}

/// Formats `value` with about four significant digits, for numbers of unknown size; NaN is unknown.
pub fn readable(value: f64) -> String {
    let size = value.abs();
    match size {
        _ if size == 0.0 || !size.is_finite() => fixed(value, 0),
        _ if size < 1e-4 => scientific(value),
        _ => fixed(value, decimals_of(size)),
    }
}

/// Formats `mean ± spread`, both with the decimals that [`readable`] gives the larger one.
pub fn readable_with_spread(mean: f64, spread: f64) -> String {
    let size = mean.abs().max(spread.abs());
    if size < 1e-4 || !size.is_finite() {
        return format!("{} ± {}", readable(mean), readable(spread));
    }
    mean_and_error(mean, spread, decimals_of(size))
}

fn decimals_of(size: f64) -> usize {
    (3.0 - size.log10().floor()).clamp(0.0, 6.0) as usize
}

/// Formats a share (0 to 1) in percent with one decimal, as `40.0 %`.
pub fn percent(share: f64) -> String {
    if share.is_nan() { UNKNOWN.to_owned() } else { format!("{} %", fixed(share * 100.0, 1)) }
}

/// Returns the decimals that show at least one digit of every standard error above 0; 2 if there is no such error.
pub(crate) fn decimals_for(errors: impl Iterator<Item = f64>) -> usize {
    let smallest = errors.filter(|e| *e > 0.0).fold(f64::INFINITY, f64::min);
    if smallest.is_finite() { (-smallest.log10().floor()).clamp(0.0, 4.0) as usize } else { 2 }
}

/// Formats a mean and, if known, its standard error.
pub fn mean_and_error(mean: f64, error: f64, decimals: usize) -> String {
    if mean.is_nan() || error.is_nan() {
        return fixed(mean, decimals);
    }
    format!("{} ± {}", fixed(mean, decimals), fixed(error, decimals))
}

/// Returns the labels of axis ticks that are `step` apart, all with the same unit prefix (no prefix, k, M, G).
pub fn tick_labels(ticks: &[f64], step: f64) -> Vec<String> {
    let largest = ticks.iter().fold(0.0f64, |m, t| m.max(t.abs()));
    if largest >= 1e13 || (largest > 0.0 && largest < 1e-3) {
        return ticks.iter().map(|t| scientific(*t)).collect();
    }
    let (unit, name) = match largest {
        l if l >= 1e9 => (1e9, "G"),
        l if l >= 1e6 => (1e6, "M"),
        l if l >= 1e4 => (1e3, "k"),
        _ => (1.0, ""),
    };
    // Steps are 1, 2, 2.5 or 5 times a power of ten.
    let step = step / unit;
    let decimals = (0..12).find(|&d| (step * 10f64.powi(d)).fract().abs() < 1e-6).unwrap_or(12) as usize;
    ticks.iter().map(|&t| if t == 0.0 { "0".to_owned() } else { fixed(t / unit, decimals) + name }).collect()
}

fn scientific(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{value:.2e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
    format!("{mantissa}e{exponent}").replace('-', "−")
}

// Results of methods as rows, and their ranks.

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
    in_pairs.map_or_else(|| one.return_se.hypot(other.return_se), |difference| difference.se)
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
    fn cells() {
        assert_eq!(fixed(-1234567.891, 1), "−1,234,567.9");
        assert_eq!(fixed(-0.001, 1), "0.0");
        assert_eq!(fixed(f64::NAN, 1), "–");
        assert_eq!(percent(0.9744), "97.4 %");
        let shown = [0.0, 8.53125, -0.00312, 0.00002, 81920.4, 1.0, f64::NAN, f64::INFINITY].map(readable);
        assert_eq!(shown, ["0", "8.531", "−0.003120", "2e−5", "81,920", "1.000", "–", "inf"]);
        assert_eq!(readable_with_spread(8.53125, 0.04041), "8.531 ± 0.040");
        assert_eq!(readable_with_spread(0.0, 0.0), "0 ± 0");
        assert_eq!(readable_with_spread(f64::NAN, f64::NAN), "– ± –");
        assert_eq!(mean_and_error(9.7432, 0.1234, 2), "9.74 ± 0.12");
        assert_eq!(mean_and_error(1234.5, 45.6, 0), "1,234 ± 46");
        assert_eq!(mean_and_error(5.0, f64::NAN, 2), "5.00");
        assert_eq!(mean_and_error(f64::NAN, 1.0, 2), "–");
        assert_eq!(decimals_for([0.5, 0.08, f64::NAN, 0.0].into_iter()), 2);
        assert_eq!(decimals_for([45.6].into_iter()), 0);
        assert_eq!(decimals_for([f64::NAN].into_iter()), 2);
    }

    #[test]
    fn ticks_share_a_unit() {
        assert_eq!(tick_labels(&[0.0, 2e6, 4e6], 2e6), ["0", "2M", "4M"]);
        assert_eq!(tick_labels(&[0.0, 0.25, 0.5], 0.25), ["0", "0.25", "0.50"]);
        assert_eq!(tick_labels(&[-500.0, 0.0, 500.0], 500.0), ["−500", "0", "500"]);
        assert_eq!(tick_labels(&[25_000.0, 50_000.0], 25_000.0), ["25k", "50k"]);
        assert_eq!(tick_labels(&[5e-5, 1e-4], 5e-5), ["5e−5", "1e−4"]);
        assert_eq!(tick_labels(&[], 1.0), [] as [&str; 0]);
    }
}

#[cfg(test)]
mod result_tests {
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

//! Spearman's rank correlation.

use serde::Serialize;

/// Number of standard deviations around the mean of a normal distribution that hold 95 % of it.
const Z_95: f64 = 1.959_963_984_540_054;

/// A rank correlation: 1 if two lists have the same order, -1 if the reverse order, 0 if their orders are unrelated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RankCorrelation {
    /// The correlation.
    pub value: f64,
    /// Its 95 % interval, by Fisher's z. `None` for too few values, and for exactly the same or the reverse order, for
    /// which the formula has no interval.
    pub interval: Option<[f64; 2]>,
}

impl RankCorrelation {
    /// Creates a correlation whose z has this variance; `None` for too few values.
    pub(super) fn new(value: f64, variance: Option<f64>) -> Self {
        let value = value.clamp(-1.0, 1.0);
        let is_exact = 1.0 - value.abs() < 1e-12;
        let interval = variance.filter(|_| !is_exact).map(|variance| {
            let z = value.atanh();
            [-Z_95, Z_95].map(|deviations| rounded((z + deviations * variance.sqrt()).tanh()))
        });
        Self { value: rounded(value), interval }
    }
}

/// Drops the digits in which machines may differ.
fn rounded(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

/// Returns Spearman's rank correlation of two lists of the same length; `None` if a list does not vary. Equal values
/// share their mean rank.
///
/// The interval is by Fisher's z with the variance of Bonett and Wright (Sample size requirements for estimating
/// Pearson, Kendall and Spearman correlations, 2000), (1 + r² / 2) / (n - 3), and needs four values.
pub fn spearman(one: &[f64], other: &[f64]) -> Option<RankCorrelation> {
    let value = pearson(&ranks(one), &ranks(other))?;
    let count = one.len().min(other.len()) as f64;
    let variance = (count > 3.0).then(|| (1.0 + value * value / 2.0) / (count - 3.0));
    Some(RankCorrelation::new(value, variance))
}

/// Returns the rank of each value, from 1; equal values have their mean rank.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|one, other| values[*one].total_cmp(&values[*other]));
    let mut ranks = vec![0.0; values.len()];
    let mut below = 0;
    for equal in order.chunk_by(|one, other| values[*one] == values[*other]) {
        let rank = below as f64 + (equal.len() + 1) as f64 / 2.0;
        equal.iter().for_each(|index| ranks[*index] = rank);
        below += equal.len();
    }
    ranks
}

fn pearson(one: &[f64], other: &[f64]) -> Option<f64> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (mean_one, mean_other) = (mean(one), mean(other));
    let (mut both, mut squares_one, mut squares_other) = (0.0, 0.0, 0.0);
    for (a, b) in one.iter().zip(other) {
        let (a, b) = (a - mean_one, b - mean_other);
        both += a * b;
        squares_one += a * a;
        squares_other += b * b;
    }
    let spread = (squares_one * squares_other).sqrt();
    (spread > 0.0).then(|| both / spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_near(found: Option<RankCorrelation>, value: f64, interval: Option<[f64; 2]>) {
        let found = found.expect("both vary");
        assert!((found.value - value).abs() < 1e-6, "{found:?}");
        assert_eq!(found.interval.is_some(), interval.is_some(), "{found:?}");
        for (found, known) in found.interval.into_iter().flatten().zip(interval.into_iter().flatten()) {
            assert!((found - known).abs() < 1e-6, "{found} is not {known}");
        }
    }

    /// Correlations by hand; intervals with Python's `math.atanh` and `math.tanh`.
    #[test]
    fn correlations_are_those_of_the_literature() {
        // Squared differences of ranks 1 + 1 + 1 + 1: 1 - 6 * 4 / (5 * 24).
        let swapped = spearman(&[1.0, 2.0, 3.0, 4.0, 5.0], &[20.0, 10.0, 40.0, 30.0, 50.0]);
        is_near(swapped, 0.8, Some([-0.457_124_389, 0.990_842_949]));
        // Squares 6 * 1 + 9 + 1 + 1 + 9: 1 - 6 * 26 / (10 * 99).
        let ten: Vec<f64> = (1..=10).map(f64::from).collect();
        let other = [2.0, 1.0, 4.0, 3.0, 6.0, 5.0, 10.0, 9.0, 8.0, 7.0];
        is_near(spearman(&ten, &other), 0.842_424_242, Some([0.351536828, 0.969966841]));
        // Ranks 1, 2.5, 2.5, 4 and 1, 2, 3, 4: 4.5 / sqrt(4.5 * 5).
        let tied = spearman(&[1.0, 7.0, 7.0, 9.0], &[1.0, 2.0, 3.0, 4.0]);
        is_near(tied, 0.948_683_298, Some([-0.494245544, 0.999530667]));
    }

    #[test]
    fn what_has_no_interval_or_no_correlation_has_none() {
        is_near(spearman(&[1.0, 2.0, 3.0], &[1.0, 3.0, 2.0]), 0.5, None);
        is_near(spearman(&[1.0, 2.0, 3.0, 4.0, 5.0], &[5.0, 4.0, 3.0, 2.0, 1.0]), -1.0, None);
        assert_eq!(spearman(&[1.0, 2.0, 3.0], &[4.0, 4.0, 4.0]), None);
        assert_eq!(spearman(&[], &[]), None);
        assert_eq!(spearman(&[1.0], &[1.0]), None);
    }
}

//! Rank correlations, Spearman's and Kendall's.

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
            let z = libm::atanh(value);
            [-Z_95, Z_95].map(|deviations| rounded(libm::tanh(z + deviations * variance.sqrt())))
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
/// Pearson, Kendall and Spearman correlations, 2000), (1 + r² / 2) / (n - 3). It needs four values.
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

// Kendall's rank correlation.

/// Returns Kendall's tau-b of two lists of the same length; `None` if a list does not vary. It counts pairs in the same
/// order, and corrects for equal values.
///
/// The interval is by Fisher's z with the variance of Fieller, Hartley and Pearson (Tests for rank correlation
/// coefficients, 1957), 0.437 / (n - 4). It needs five values.
pub fn kendall(one: &[f64], other: &[f64]) -> Option<RankCorrelation> {
    let mut pairs: Vec<(f64, f64)> = one.iter().copied().zip(other.iter().copied()).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let all = pairs_of(pairs.len());
    let equal = |same: fn(&(f64, f64), &(f64, f64)) -> bool, pairs: &[(f64, f64)]| -> f64 {
        pairs.chunk_by(same).map(|equal| pairs_of(equal.len())).sum()
    };
    let equal_one = equal(|a, b| a.0 == b.0, &pairs);
    let equal_both = equal(|a, b| a == b, &pairs);
    let mut others: Vec<f64> = pairs.iter().map(|pair| pair.1).collect();
    // Knight 1966: the number of pairs in opposite order equals the number of swaps of a sort.
    let swaps = sort(&mut others);
    let equal_other: f64 = others.chunk_by(|a, b| a == b).map(|equal| pairs_of(equal.len())).sum();
    let spread = ((all - equal_one) * (all - equal_other)).sqrt();
    if spread <= 0.0 {
        return None;
    }
    let value = (all - equal_one - equal_other + equal_both - 2.0 * swaps as f64) / spread;
    let count = pairs.len() as f64;
    Some(RankCorrelation::new(value, (count > 4.0).then(|| 0.437 / (count - 4.0))))
}

/// Returns the number of pairs among `count` values.
fn pairs_of(count: usize) -> f64 {
    count as f64 * (count as f64 - 1.0) / 2.0
}

/// Sorts by merging, and counts the pairs that were in the wrong order.
fn sort(values: &mut [f64]) -> u64 {
    if values.len() < 2 {
        return 0;
    }
    let middle = values.len() / 2;
    let (left, right) = values.split_at_mut(middle);
    let mut swaps = sort(left) + sort(right);
    let mut merged = Vec::with_capacity(left.len() + right.len());
    let (mut i, mut j) = (0, 0);
    while i < left.len() || j < right.len() {
        if j == right.len() || (i < left.len() && left[i] <= right[j]) {
            merged.push(left[i]);
            i += 1;
        } else {
            merged.push(right[j]);
            swaps += (left.len() - i) as u64;
            j += 1;
        }
    }
    values.copy_from_slice(&merged);
    swaps
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

    /// Tau-b as it is defined, pair by pair.
    fn by_pairs(one: &[f64], other: &[f64]) -> f64 {
        let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
        for i in 0..one.len() {
            for j in 0..i {
                let sign = |values: &[f64]| if values[i] == values[j] { 0.0 } else { (values[i] - values[j]).signum() };
                let (a, b) = (sign(one), sign(other));
                sum += a * b;
                first += a * a;
                second += b * b;
            }
        }
        sum / f64::sqrt(first * second)
    }

    #[test]
    fn tau_is_that_of_all_pairs() {
        let found = |one: &[f64], other: &[f64]| kendall(one, other).expect("both vary").value;
        // Eight pairs in order, two not.
        let (one, other) = ([1.0, 2.0, 3.0, 4.0, 5.0], [20.0, 10.0, 40.0, 30.0, 50.0]);
        assert!((found(&one, &other) - 0.6).abs() < 1e-9);
        // Five of six pairs in order, one of equal values: 5 / sqrt(5 * 6).
        assert!((found(&[1.0, 7.0, 7.0, 9.0], &[1.0, 2.0, 3.0, 4.0]) - 0.912_870_929).abs() < 1e-6);
        let numbers = |factor: u64| (1..60).map(|n| (n * factor % 11) as f64).collect::<Vec<f64>>();
        for factor in [3, 5, 8] {
            let (one, other) = (numbers(7), numbers(factor * factor + 1));
            assert!((found(&one, &other) - by_pairs(&one, &other)).abs() < 1e-8, "{factor}");
        }
    }

    #[test]
    fn intervals_are_those_of_fisher() {
        let [low, high] = kendall(&[1.0, 2.0, 3.0, 4.0, 5.0], &[20.0, 10.0, 40.0, 30.0, 50.0])
            .and_then(|found| found.interval)
            .expect("five values");
        assert!((low + 0.538_830_474).abs() < 1e-6 && (high - 0.963_227_723).abs() < 1e-6, "{low} to {high}");
        let four = kendall(&[1.0, 2.0, 3.0, 4.0], &[1.0, 3.0, 2.0, 4.0]).expect("both vary");
        assert_eq!(four.interval, None);
        assert_eq!(kendall(&[1.0, 2.0], &[3.0, 3.0]), None);
        assert_eq!(kendall(&[], &[]), None);
    }
}

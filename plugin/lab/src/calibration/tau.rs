//! Kendall's rank correlation.

use super::rank::RankCorrelation;

/// Returns Kendall's tau-b of two lists of the same length; `None` if a list does not vary. It counts pairs in the same
/// order, and corrects for equal values.
///
/// The interval is by Fisher's z with the variance of Fieller, Hartley and Pearson (Tests for rank correlation
/// coefficients, 1957), 0.437 / (n - 4), and needs five values.
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

//! Statistics of shares: Wilson intervals, Fisher's exact test, and control of the false discovery rate.

use serde::Serialize;

/// Number of standard deviations around the mean of a normal distribution that hold 95 % of it.
const Z_95: f64 = 1.959_963_984_540_054;

/// Returns the 95 % Wilson score interval of a share: lowest and highest share that are plausible given `successes`
/// of `trials` (Wilson 1927). `[0, 1]` without trials.
pub fn wilson(successes: u64, trials: u64) -> [f64; 2] {
    if trials == 0 {
        return [0.0, 1.0];
    }
    let n = trials as f64;
    let share = successes as f64 / n;
    let z2 = Z_95 * Z_95;
    let middle = (share + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z_95 / (1.0 + z2 / n) * (share * (1.0 - share) / n + z2 / (4.0 * n * n)).sqrt();
    // At the ends the formula gives exactly 0 and 1, but for rounding.
    let low = if successes == 0 { 0.0 } else { (middle - half).max(0.0) };
    let high = if successes >= trials { 1.0 } else { (middle + half).min(1.0) };
    [low, high]
}

/// Successes among trials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Trials {
    /// Number of successes.
    pub successes: u64,
    /// Number of trials.
    pub trials: u64,
}

/// Largest number of trials: larger ones are not from real play.
const MOST_TRIALS: u64 = 1 << 34;

/// Likelihood relative to the observed table below which tables do not count, in any number.
const LEAST_WEIGHT: f64 = 1e-30;

/// Computes Fisher's exact test (1922), two-sided, equal to R's `fisher.test`. The result is the probability of a
/// table at most as likely as this one, under equal chances of success and given totals. Returns 1 for impossible
/// numbers.
pub fn fisher_exact(one: Trials, other: Trials) -> f64 {
    if [one, other].iter().any(|of| of.successes > of.trials || of.trials > MOST_TRIALS) {
        return 1.0;
    }
    let successes = one.successes + other.successes;
    let lowest = successes.saturating_sub(other.trials);
    let highest = successes.min(one.trials);
    // Likelihood of a table in units of the observed one: neighbours differ by a simple factor.
    let factor_up = |x: u64| {
        let up = (successes - x) as f64 * (one.trials - x) as f64;
        up / ((x + 1) as f64 * (other.trials + x + 1 - successes) as f64)
    };
    let more = Tail::of((one.successes..highest).map(factor_up));
    let fewer = Tail::of((lowest..one.successes).rev().map(|x| factor_up(x).recip()));
    // The observed table itself is the unit.
    let (extreme, all) = (1.0 + more.extreme + fewer.extreme, 1.0 + more.all + fewer.all);
    (extreme / all).min(1.0)
}

/// Tables to one side of the observed one, in its units.
#[derive(Default)]
struct Tail {
    all: f64,
    /// Sum of those that are at most as likely as the observed one.
    extreme: f64,
}

impl Tail {
    /// Sums the tables from the ratios of their likelihoods, each to the one before.
    ///
    /// The ratios only fall, so the tables become more likely first and then less. The sum ends at terms that no
    /// longer count.
    fn of(factors: impl Iterator<Item = f64>) -> Self {
        let (mut tail, mut weight) = (Self::default(), 1.0);
        for factor in factors {
            weight *= factor;
            tail.all += weight;
            // Equally likely tables differ from the observed one by rounding only.
            if weight <= 1.0 + 1e-7 {
                tail.extreme += weight;
            }
            let is_spent = factor < 1.0 && weight < LEAST_WEIGHT;
            if is_spent || !tail.all.is_finite() {
                break;
            }
        }
        tail
    }
}

/// Returns which of these probabilities are significant, with an expected share of false alarms of at most `rate`
/// among all alarms.
///
/// Method of Benjamini and Hochberg (1995): the `k` smallest, with the largest `k` whose `k`-th smallest is at most
/// `k / n * rate`.
pub fn benjamini_hochberg(probabilities: &[f64], rate: f64) -> Vec<bool> {
    let mut sorted = probabilities.to_vec();
    sorted.sort_by(f64::total_cmp);
    let count = sorted.len() as f64;
    let is_small = |(index, p): (usize, &f64)| *p <= (index + 1) as f64 / count * rate;
    let last = sorted.iter().enumerate().rev().find(|(index, p)| is_small((*index, p)));
    let limit = last.map(|(_, p)| *p);
    probabilities.iter().map(|p| limit.is_some_and(|limit| *p <= limit)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checked against `binom.confint(x, n, methods = "wilson")` of R's package binom.
    #[test]
    fn intervals_are_those_of_the_literature() {
        for (successes, trials, low, high) in [
            (8, 10, 0.490_162_5, 0.943_317_8),
            (0, 10, 0.0, 0.277_532_8),
            (10, 10, 0.722_467_2, 1.0),
            (1, 1, 0.206_549_3, 1.0),
            (50, 100, 0.403_831_5, 0.596_168_5),
        ] {
            let [found_low, found_high] = wilson(successes, trials);
            assert!((found_low - low).abs() < 1e-6 && (found_high - high).abs() < 1e-6, "{successes} of {trials}");
        }
        assert_eq!(wilson(0, 0), [0.0, 1.0]);
    }

    /// Checked against R's `fisher.test`.
    #[test]
    fn probabilities_are_those_of_the_literature() {
        let p = |a, n, b, m| fisher_exact(Trials { successes: a, trials: n }, Trials { successes: b, trials: m });
        for (found, known) in [
            // The lady tasting tea.
            (p(3, 4, 1, 4), 0.485_714_3),
            (p(1, 10, 11, 14), 0.002_759_456),
            (p(0, 5, 5, 5), 0.007_936_508),
            (p(10, 10, 5, 10), 0.032_507_74),
        ] {
            assert!((found - known).abs() < 1e-6, "{found} is not {known}");
        }
        assert_eq!((p(1, 1, 0, 1), p(3, 3, 9, 9), p(0, 0, 0, 4)), (1.0, 1.0, 1.0));
    }

    #[test]
    fn both_sides_are_treated_alike() {
        for (a, b) in [(0, 7), (2, 9), (5, 5), (12, 1)] {
            let (one, other) = (Trials { successes: a, trials: 12 }, Trials { successes: b, trials: 9 });
            assert!((fisher_exact(one, other) - fisher_exact(other, one)).abs() < 1e-12);
        }
    }

    #[test]
    fn many_trials_give_a_probability_too() {
        let (one, other) =
            (Trials { successes: 90_000, trials: 100_000 }, Trials { successes: 10_000, trials: 100_000 });
        let p = fisher_exact(one, other);
        assert!((0.0..1e-9).contains(&p), "{p}");
    }

    #[test]
    fn numbers_without_an_episode_take_no_time() {
        let p = |a, n, b, m| fisher_exact(Trials { successes: a, trials: n }, Trials { successes: b, trials: m });
        assert_eq!((p(u64::MAX, u64::MAX, 0, 4), p(5, 4, 0, 4), p(0, u64::MAX, 7, 9)), (1.0, 1.0, 1.0));
        let half = MOST_TRIALS / 2;
        assert!(p(half, MOST_TRIALS, half, MOST_TRIALS) > 0.999, "as likely as can be");
        assert!(p(0, MOST_TRIALS, MOST_TRIALS, MOST_TRIALS) < 1e-300);
    }

    /// The example of Benjamini and Hochberg (1995), section 4.
    #[test]
    fn the_example_of_the_paper_has_four_alarms() {
        let p = [
            0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262, 0.5719, 0.6528,
            0.7590, 1.0,
        ];
        let alarms = benjamini_hochberg(&p, 0.05);
        assert_eq!(alarms, [[true; 4].as_slice(), &[false; 11]].concat());
    }

    #[test]
    fn a_larger_one_counts_if_those_below_it_do_and_the_order_is_kept() {
        // 0.03 is above 0.05 / 3, and 0.04 above 2 / 3 * 0.05.
        assert_eq!(benjamini_hochberg(&[0.04, 0.9, 0.03], 0.05), [false; 3]);
        assert_eq!(benjamini_hochberg(&[0.04, 0.045, 0.03], 0.05), [true; 3]);
        assert_eq!(benjamini_hochberg(&[0.9, 0.001], 0.05), [false, true]);
        assert!(benjamini_hochberg(&[], 0.05).is_empty());
    }
}

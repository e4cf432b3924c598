//! Fisher's exact test for two shares of successes.

use serde::Serialize;

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

#[cfg(test)]
mod tests {
    use super::*;

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
    fn numbers_that_nobody_has_played_take_no_time() {
        let p = |a, n, b, m| fisher_exact(Trials { successes: a, trials: n }, Trials { successes: b, trials: m });
        assert_eq!((p(u64::MAX, u64::MAX, 0, 4), p(5, 4, 0, 4), p(0, u64::MAX, 7, 9)), (1.0, 1.0, 1.0));
        let half = MOST_TRIALS / 2;
        assert!(p(half, MOST_TRIALS, half, MOST_TRIALS) > 0.999, "as likely as can be");
        assert!(p(0, MOST_TRIALS, MOST_TRIALS, MOST_TRIALS) < 1e-300);
    }
}

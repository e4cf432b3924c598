//! Whether two shares of successes differ.

use serde::Serialize;

/// Successes among trials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Trials {
    /// Those that succeeded.
    pub successes: u64,
    /// All of them.
    pub trials: u64,
}

/// Trials beyond which nothing is computed: nobody has played so often, so that the numbers are made up.
const MOST_TRIALS: u64 = 1 << 34;

/// Tables that are so much less likely than the observed one do not count, however many of them there are.
const LEAST_WEIGHT: f64 = 1e-30;

/// Fisher's exact test (1922), two-sided: the probability of a table that is at most as likely as this one, if both had the
/// same chance of success, given the totals. As R's `fisher.test` has it. 1 for numbers that cannot be.
pub fn fisher_exact(one: Trials, other: Trials) -> f64 {
    if [one, other].iter().any(|of| of.successes > of.trials || of.trials > MOST_TRIALS) {
        return 1.0;
    }
    let successes = one.successes + other.successes;
    let lowest = successes.saturating_sub(other.trials);
    let highest = successes.min(one.trials);
    // How likely a table is, in units of the observed one: neighbours differ by a simple factor.
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

/// The tables to one side of the observed one, in its units.
#[derive(Default)]
struct Tail {
    all: f64,
    /// Those that are at most as likely as the observed one.
    extreme: f64,
}

impl Tail {
    /// From the factors by which each table is more likely than the one before it. These only fall, so that tables become more
    /// likely first and then less: the sum ends where what follows no longer counts.
    fn of(factors: impl Iterator<Item = f64>) -> Self {
        let (mut tail, mut weight) = (Self::default(), 1.0);
        for factor in factors {
            weight *= factor;
            tail.all += weight;
            // Tables that are just as likely differ from the observed one by rounding only.
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
            // The lady who tastes tea.
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

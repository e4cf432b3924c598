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

/// Fisher's exact test (1922), two-sided: the probability of a table that is at most as likely as this one, if both had the
/// same chance of success, given the totals. As R's `fisher.test` has it.
pub fn fisher_exact(one: Trials, other: Trials) -> f64 {
    let successes = one.successes + other.successes;
    let lowest = successes.saturating_sub(other.trials);
    let highest = successes.min(one.trials);
    // How likely a table is, in units of the observed one: neighbours differ by a simple factor.
    let factor_up = |x: u64| {
        let up = (successes - x) as f64 * (one.trials - x) as f64;
        up / ((x + 1) as f64 * (other.trials + x + 1 - successes) as f64)
    };
    let mut weights = vec![1.0];
    let mut weight = 1.0;
    for x in one.successes..highest {
        weight *= factor_up(x);
        weights.push(weight);
    }
    weight = 1.0;
    for x in (lowest..one.successes).rev() {
        weight /= factor_up(x);
        weights.push(weight);
    }
    // Tables that are just as likely differ from the observed one by rounding only.
    let extreme: f64 = weights.iter().filter(|weight| **weight <= 1.0 + 1e-7).sum();
    (extreme / weights.iter().sum::<f64>()).min(1.0)
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
}

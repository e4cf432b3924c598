//! Wilson intervals of shares.

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
}

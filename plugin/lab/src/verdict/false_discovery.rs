//! Control of the false discovery rate over many tests.

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

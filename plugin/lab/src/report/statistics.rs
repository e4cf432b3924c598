//! Statistics over runs that differ only in their seed.

use super::bootstrap::{self, Estimate};

/// Returns the mean and sample standard deviation (with n - 1) of the values; the deviation of a single value is 0.
///
/// Both are NaN without values.
pub fn mean_and_sd(values: &[f64]) -> (f64, f64) {
    match values {
        [] => return (f64::NAN, f64::NAN),
        [value] => return (*value, 0.0),
        _ => {}
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0)).sqrt())
}

/// Returns the median, which is the mean of the two middle values of an even number; `None` without values.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some(f64::midpoint(values[last / 2], values[last.div_ceil(2)]))
}

/// Returns the first step at which a learning curve of `(step, value)` is at `threshold` or above; `None` if it never
/// is.
///
/// A single good value counts. So the curve should be a moving mean, as `charts/success_rate` and
/// `charts/episodic_return` are: over the last 100 episodes.
pub fn steps_to_reach(curve: &[(u64, f64)], threshold: f64) -> Option<u64> {
    curve.iter().find(|(_, value)| *value >= threshold).map(|(step, _)| *step)
}

/// Returns the value of a curve at a step, interpolated linearly between its points, whose steps ascend. `None`
/// before its first and after its last point.
pub fn value_at(curve: &[(u64, f64)], step: u64) -> Option<f64> {
    let after = curve.partition_point(|(at, _)| *at < step);
    let (right, right_value) = *curve.get(after)?;
    if right == step {
        return Some(right_value);
    }
    let (left, left_value) = *curve.get(after.checked_sub(1)?)?;
    let share = (step - left) as f64 / (right - left) as f64;
    Some(left_value + share * (right_value - left_value))
}

/// Mean and interval of several curves at a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanPoint {
    /// The step.
    pub step: u64,
    /// Mean of the curves.
    pub mean: f64,
    /// Lower end of the 95 % interval of the mean.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Returns the mean of several learning curves with its 95 % interval over such curves: see [`bootstrap::mean`].
///
/// Points are at every step of any curve, from the latest first step to the earliest last step. So each mean is over
/// all curves.
pub fn mean_curve(curves: &[Vec<(u64, f64)>]) -> Vec<MeanPoint> {
    let mut steps: Vec<u64> = curves.iter().flatten().map(|(step, _)| *step).collect();
    steps.sort_unstable();
    steps.dedup();
    let point = |step| {
        let values = curves.iter().map(|curve| value_at(curve, step)).collect::<Option<Vec<f64>>>()?;
        let Estimate { value, low, high } = bootstrap::mean(&values)?;
        Some(MeanPoint { step, mean: value, low, high })
    };
    steps.into_iter().filter_map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_sample_deviation() {
        // Deviations from 5: -3, -1, 4; squares 9 + 1 + 16 = 26; over n - 1 = 2.
        assert_eq!(mean_and_sd(&[2.0, 4.0, 9.0]), (5.0, 13f64.sqrt()));
        assert_eq!(mean_and_sd(&[7.0]), (7.0, 0.0));
        assert!(mean_and_sd(&[]).0.is_nan() && mean_and_sd(&[]).1.is_nan());
    }

    #[test]
    fn the_first_crossing_counts() {
        let curve = [(10, f64::NAN), (20, 0.5), (30, 0.8), (40, 0.7), (50, 0.9)];
        assert_eq!(steps_to_reach(&curve, 0.8), Some(30));
        assert_eq!(steps_to_reach(&curve, 0.81), Some(50));
        assert_eq!(steps_to_reach(&curve, 0.95), None);
        assert_eq!(steps_to_reach(&[], 0.0), None);
    }

    #[test]
    fn values_between_points_lie_on_the_line() {
        let curve = [(10, 1.0), (20, 3.0), (60, 1.0)];
        let at = |step| value_at(&curve, step);
        assert_eq!([at(10), at(15), at(20), at(30), at(60)], [Some(1.0), Some(2.0), Some(3.0), Some(2.5), Some(1.0)]);
        assert_eq!([at(9), at(61), value_at(&[], 5)], [None; 3]);
    }

    #[test]
    fn a_mean_is_that_of_all_curves() {
        let short = vec![(10, 1.0), (30, 3.0)];
        let long = vec![(0, 9.0), (10, 3.0), (20, 6.0), (40, 0.0)];
        let points = mean_curve(&[short.clone(), long.clone()]);
        let expected = [(10, 2.0, 1.0, 3.0), (20, 4.0, 2.0, 6.0), (30, 3.0, 3.0, 3.0)];
        assert_eq!(points, expected.map(|(step, mean, low, high)| MeanPoint { step, mean, low, high }));

        let third = vec![(10, 8.0), (30, 3.0)];
        let at_10 = mean_curve(&[short, long, third])[0];
        // Of the 27 draws of three from 1, 3 and 8, one has mean 1 and one has mean 8: more than 2.5 % each.
        assert_eq!((at_10.mean, at_10.low, at_10.high), (4.0, 1.0, 8.0));
        assert!(mean_curve(&[]).is_empty() && mean_curve(&[vec![]]).is_empty());
    }

    #[test]
    fn a_median_lies_in_the_middle() {
        assert_eq!(median(vec![9.0, 1.0, 4.0]), Some(4.0));
        assert_eq!(median(vec![9.0, 1.0, 4.0, 5.0]), Some(4.5));
        assert_eq!(median(vec![7.0]), Some(7.0));
        assert_eq!(median(Vec::new()), None);
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!((median(vec![7.0]), median(Vec::new())), (Some(7.0), None));
    }
}

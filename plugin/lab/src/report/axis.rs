//! Axes: ranges of values with round tick positions.

/// Largest magnitude that counts as finite: differences of larger ones overflow.
pub(super) const LARGEST: f64 = 1e300;

/// Returns whether a value can be drawn.
pub(super) fn is_drawable(value: f64) -> bool {
    value.abs() <= LARGEST
}

/// An axis: a range that is never empty, and ticks inside it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Tick positions in ascending order, `step` apart.
    pub ticks: Vec<f64>,
    /// Distance between two ticks.
    pub step: f64,
}

impl Axis {
    /// Makes a range with exactly the drawable values; the ticks lie inside.
    pub fn tight(values: impl Iterator<Item = f64>, ticks: usize) -> Self {
        let (low, high) = range(values);
        let step = round_step((high - low) / ticks as f64);
        Self::with_step(low, high, step)
    }

    /// Makes a range that begins and ends at a tick; it includes 0 when the values come close to it.
    pub fn rounded(values: impl Iterator<Item = f64>, ticks: usize) -> Self {
        let (mut low, mut high) = range(values);
        if low > 0.0 && low < 0.4 * high {
            low = 0.0;
        } else if high < 0.0 && high > 0.4 * low {
            high = 0.0;
        }
        let step = round_step((high - low) / ticks as f64);
        // The small number keeps a value that is a tick, up to rounding, from adding a step.
        let (down, up) = ((low / step + 1e-9).floor() * step, (high / step - 1e-9).ceil() * step);
        Self::with_step(down, up, step)
    }

    fn with_step(low: f64, high: f64, step: f64) -> Self {
        let first = (low / step - 1e-6).ceil();
        let last = (high / step + 1e-6).floor();
        let count = (last - first).clamp(0.0, 50.0) as usize;
        // Adding 0.0 turns -0.0 into 0.0.
        let ticks = (0..=count).map(|i| (first + i as f64) * step + 0.0).collect();
        Self { low, high, ticks, step }
    }

    /// Returns the position of a value: 0 at the low end, 1 at the high end.
    pub fn place(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }
}

/// Returns the range of the drawable values, widened if it would be empty.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) =
        values.filter(|v| is_drawable(*v)).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        return (0.0, 1.0);
    }
    // Below this distance, the ticks would be rounding errors.
    let least = (low.abs().max(high.abs()) * 1e-9).max(1e-290);
    if high - low > least {
        return (low, high);
    }
    if low.abs() < 1e-280 {
        // Values that are all 0 are mostly counts, rates or times.
        return (0.0, 1.0);
    }
    let margin = low.abs() * 0.1;
    (low - margin, high + margin)
}

/// Returns the next larger of 1, 2, 2.5, 5 times a power of ten.
fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    let digits = step / power;
    let rounded = [1.0, 2.0, 2.5, 5.0].into_iter().find(|d| digits <= d + 1e-9).unwrap_or(10.0);
    rounded * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_ticks() {
        let axis = Axis::rounded([0.3, 9.7].into_iter(), 5);
        assert_eq!((axis.low, axis.high, axis.ticks), (0.0, 10.0, vec![0.0, 2.0, 4.0, 6.0, 8.0, 10.0]));
        let axis = Axis::tight([0.0, 7.7e6].into_iter(), 5);
        assert_eq!((axis.high, axis.ticks), (7.7e6, vec![0.0, 2e6, 4e6, 6e6]));
    }

    #[test]
    fn degenerate_ranges_are_widened() {
        for values in [
            vec![],
            vec![f64::NAN],
            vec![5.0],
            vec![0.0, 0.0],
            vec![-1e-300],
            vec![1e300, -1e300],
            vec![1e16, 1e16 + 2.0],
        ] {
            for axis in [Axis::tight(values.iter().copied(), 5), Axis::rounded(values.iter().copied(), 5)] {
                assert!(axis.low < axis.high && axis.high.is_finite(), "{values:?}: {axis:?}");
                assert!((1..=51).contains(&axis.ticks.len()), "{values:?}: {axis:?}");
                assert!(axis.ticks.iter().all(|t| t.is_finite()), "{values:?}: {axis:?}");
            }
        }
    }

    #[test]
    fn nothing_at_all_needs_no_negative_axis() {
        let axis = Axis::rounded([0.0, 0.0].into_iter(), 5);
        assert_eq!((axis.low, axis.high), (0.0, 1.0));
        let axis = Axis::rounded([0.3; 4].into_iter(), 5);
        assert!(axis.low >= 0.0 && axis.high > 0.3, "{axis:?}");
    }

    #[test]
    fn values_far_from_zero_do_not_drag_it_in() {
        let axis = Axis::rounded([90.0, 97.0].into_iter(), 5);
        assert!(axis.low >= 88.0, "{axis:?}");
    }
}

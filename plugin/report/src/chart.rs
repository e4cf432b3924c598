//! Line charts: their data, SVG paths, axes and labelled marks.

use crate::text_table::text_width;
use std::fmt::Write;

/// One line of a chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// Name of the line, written beside it.
    pub label: String,
    /// The points `(x, y)` in the order they are joined. A point that is not finite is a gap.
    pub points: Vec<(f64, f64)>,
    /// Lower and upper end of a band around the line, one pair for each point: the range over the seeds,
    /// or mean ± standard deviation. Pairs that are not finite are left out.
    pub band: Option<Vec<(f64, f64)>>,
    /// True if its points are dots without a line.
    pub is_scatter: bool,
}

impl Curve {
    /// Makes a line without a band.
    pub fn new(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self { label: label.into(), points, ..Self::default() }
    }

    /// Makes dots without a line.
    pub fn scatter(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self { is_scatter: true, ..Self::new(label, points) }
    }

    /// Adds a band of `(low, high)`, one pair for each point.
    pub fn with_band(mut self, band: Vec<(f64, f64)>) -> Self {
        self.band = Some(band);
        self
    }

    /// Returns the number of points that are gaps.
    pub(crate) fn gaps(&self) -> usize {
        self.points.iter().filter(|p| !is_point(p)).count()
    }

    /// Returns whether nothing can be drawn.
    pub(crate) fn is_blank(&self) -> bool {
        self.gaps() == self.points.len()
    }
}

/// Returns whether a point can be drawn.
pub fn is_point(&(x, y): &(f64, f64)) -> bool {
    is_drawable(x) && is_drawable(y)
}

/// A line chart.
///
/// ```
/// use playbot_report::{Chart, Curve};
///
/// let chart = Chart {
///     title: "Return on held-out levels".into(),
///     x_label: "environment steps".into(),
///     y_label: "episodic return".into(),
///     curves: vec![Curve::new("SCORE-PPO", vec![(0.0, 2.1), (1e6, 7.9), (2e6, 9.4)])],
///     y_range: None,
///     marks: vec![("policy starts to change".into(), 2e5)],
///     notes: vec!["Curves begin once 100 episodes have ended.".into()],
/// };
/// assert!(chart.to_svg().starts_with("<svg "));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Headline of the chart.
    pub title: String,
    /// Label of the x axis, with its unit.
    pub x_label: String,
    /// Label of the y axis, with its unit.
    pub y_label: String,
    /// The lines, in the order of their colours.
    pub curves: Vec<Curve>,
    /// Least range of the y axis, such as 0 to 1 for a rate; `None` for the range of the values.
    pub y_range: Option<(f64, f64)>,
    /// Vertical marks: a label and its x.
    pub marks: Vec<(String, f64)>,
    /// Sentences below the plot.
    pub notes: Vec<String>,
}

impl Chart {
    /// Returns the chart's own notes, and those about values that are missing from the picture.
    pub(crate) fn footnotes(&self) -> Vec<String> {
        let mut notes = self.notes.clone();
        let gaps: Vec<String> = self
            .curves
            .iter()
            .filter(|c| !c.is_blank() && c.gaps() > 0)
            .map(|c| format!("{} ({} of {})", c.label, c.gaps(), c.points.len()))
            .collect();
        if !gaps.is_empty() {
            notes.push(format!("Gaps are values that are not finite numbers: {}.", gaps.join(", ")));
        }
        let blank: Vec<&str> = self.curves.iter().filter(|c| c.is_blank()).map(|c| c.label.as_str()).collect();
        if !blank.is_empty() {
            notes.push(format!("Without any value to draw: {}.", blank.join(", ")));
        }
        notes
    }
}

/// A vertical mark with its position in the drawing. Labels stand above the plot, in as few rows as possible.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mark {
    pub label: String,
    /// Position of the line in pixels.
    pub x: f64,
    /// Row of the label, 0 just above the plot.
    pub row: usize,
    /// True if the label is left of the line, for lack of room at its right.
    pub label_left: bool,
}

impl Mark {
    /// Positions the marks that can be drawn, in a drawing of the given width, with a font size in pixels.
    ///
    /// Labels do not overlap. As far as possible, the line of a mark misses the labels of others: the line of the
    /// leftmost mark is the longest.
    pub fn place(marks: &[(String, f64)], width: f64, size: f64, px: impl Fn(f64) -> f64) -> Vec<Self> {
        let mut placed: Vec<PlacedMark> = marks
            .iter()
            .filter(|(_, x)| is_drawable(*x))
            .map(|(label, x)| {
                let (x, room) = (px(*x), text_width(label, size) + 8.0);
                let label_left = x + room > width;
                let (start, end) = if label_left { (x - room, x) } else { (x, x + room) };
                PlacedMark { mark: Self { label: label.clone(), x, row: 0, label_left }, start, end }
            })
            .collect();
        // Labels at the right of their line from right to left, then those at the left from left to right.
        placed.sort_by(|a, b| {
            let (a, b) = (&a.mark, &b.mark);
            let by_x = if a.label_left { a.x.total_cmp(&b.x) } else { b.x.total_cmp(&a.x) };
            a.label_left.cmp(&b.label_left).then(by_x)
        });
        for i in 1..placed.len() {
            let (before, rest) = placed.split_at_mut(i);
            let PlacedMark { mark, start, end } = &mut rest[0];
            let overlapping = before.iter().filter(|other| other.start < *end && *start < other.end);
            mark.row = overlapping.map(|other| other.mark.row + 1).max().unwrap_or(0);
        }
        placed.into_iter().map(|placed| placed.mark).collect()
    }
}

/// A mark, with the ends of its label.
struct PlacedMark {
    mark: Mark,
    start: f64,
    end: f64,
}

// SVG paths of a curve: gaps, bands, and no more points than pixels.

/// A point on the drawing, in pixels, with its band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Dot {
    pub x: f64,
    pub y: f64,
    /// Lower and upper end of the band.
    pub band: Option<(f64, f64)>,
}

/// Returns the stretches of a curve without gaps, in pixels, thinned to visible differences. Each point of a scatter
/// is a stretch.
pub(crate) fn stretches(curve: &Curve, x: impl Fn(f64) -> f64, y: impl Fn(f64) -> f64) -> Vec<Vec<Dot>> {
    if curve.is_scatter {
        let dots = curve.points.iter().filter(|point| is_point(point));
        return dots.map(|point| vec![Dot { x: x(point.0), y: y(point.1), band: None }]).collect();
    }
    let band = |i: usize| curve.band.as_ref()?.get(i).copied().filter(is_point);
    let mut stretches = vec![Vec::new()];
    for (i, point) in curve.points.iter().enumerate() {
        if is_point(point) {
            let band = band(i).map(|(low, high)| (y(low), y(high)));
            stretches.last_mut().expect("never empty").push(Dot { x: x(point.0), y: y(point.1), band });
        } else {
            stretches.push(Vec::new());
        }
    }
    stretches.into_iter().filter(|s| !s.is_empty()).map(thin).collect()
}

/// Keeps the lowest and the highest point of each half pixel, if there are many.
fn thin(dots: Vec<Dot>) -> Vec<Dot> {
    if dots.len() <= 1500 || !dots.is_sorted_by(|a, b| a.x <= b.x) {
        return dots;
    }
    let mut kept = Vec::new();
    for group in dots.chunk_by(|a, b| (a.x * 2.0).floor() == (b.x * 2.0).floor()) {
        let by_height = |a: &&Dot, b: &&Dot| a.y.total_cmp(&b.y);
        let (Some(top), Some(bottom)) = (group.iter().min_by(by_height), group.iter().max_by(by_height)) else {
            continue;
        };
        // The widest band of the group; drawing coordinates grow downwards.
        let band = group.iter().filter_map(|d| d.band).reduce(|(low, high), (l, h)| (low.max(l), high.min(h)));
        let (first, second) = if top.x <= bottom.x { (top, bottom) } else { (bottom, top) };
        kept.push(Dot { band, ..*first });
        if first != second {
            kept.push(Dot { band, ..*second });
        }
    }
    kept
}

/// Returns the `d` attribute of a line through the dots.
pub(crate) fn line_path(dots: &[Dot]) -> String {
    let mut path = String::new();
    for (i, dot) in dots.iter().enumerate() {
        let _ = write!(path, "{}{:.1} {:.1}", if i == 0 { "M" } else { "L" }, dot.x, dot.y);
    }
    path
}

/// Returns the `d` attributes of the areas between the ends of the bands.
pub(crate) fn band_paths(dots: &[Dot]) -> Vec<String> {
    dots.split(|d| d.band.is_none())
        .filter(|part| part.len() > 1)
        .map(|part| {
            let edge = |upper: bool| {
                part.iter().filter_map(move |d| d.band.map(|(low, high)| (d.x, if upper { high } else { low })))
            };
            let mut path = String::new();
            for (i, (x, y)) in edge(true).chain(edge(false).rev()).enumerate() {
                let _ = write!(path, "{}{x:.1} {y:.1}", if i == 0 { "M" } else { "L" });
            }
            path + "Z"
        })
        .collect()
}

// Axes: ranges of values with round tick positions.

/// Largest magnitude that counts as finite: differences of larger ones overflow.
pub(crate) const LARGEST: f64 = 1e300;

/// Returns whether a value can be drawn.
pub(crate) fn is_drawable(value: f64) -> bool {
    value.abs() <= LARGEST
}

/// An axis: a range that is never empty, and ticks inside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
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
    let power = 10f64.powi(libm::log10(step).floor() as i32);
    let digits = step / power;
    let rounded = [1.0, 2.0, 2.5, 5.0].into_iter().find(|d| digits <= d + 1e-9).unwrap_or(10.0);
    rounded * power
}

const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Draws the values as bars of different height, from the lowest to the highest value. Each of at most `width`
/// characters stands for the mean of its share of the values. Values that are not finite are left out; a share
/// without other values is a space.
pub fn sparkline(values: &[f64], width: usize) -> String {
    let size = values.len().div_ceil(width.max(1)).max(1);
    let means: Vec<f64> = values
        .chunks(size)
        .map(|chunk| {
            let known: Vec<f64> = chunk.iter().copied().filter(|value| value.is_finite()).collect();
            known.iter().sum::<f64>() / known.len() as f64
        })
        .collect();
    let low = means.iter().copied().fold(f64::NAN, f64::min);
    let high = means.iter().copied().fold(f64::NAN, f64::max);
    // A level curve is drawn at its bottom.
    let scale = if high > low { (BARS.len() - 1) as f64 / (high - low) } else { 0.0 };
    means.iter().map(|mean| if mean.is_nan() { ' ' } else { BARS[((mean - low) * scale).round() as usize] }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_splits_the_line() {
        let points = vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0), (3.0, 4.0), (4.0, f64::INFINITY)];
        let parts = stretches(&Curve::new("a", points), |x| x, |y| y);
        assert_eq!(parts.iter().map(Vec::len).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(line_path(&parts[1]), "M2.0 3.0L3.0 4.0");
        assert!(stretches(&Curve::default(), |x| x, |y| y).is_empty());
    }

    #[test]
    fn a_band_follows_the_points() {
        let curve = Curve::new("a", vec![(0.0, 1.0), (1.0, 2.0), (2.0, 3.0)]).with_band(vec![
            (0.0, 2.0),
            (1.0, 3.0),
            (f64::NAN, 4.0),
        ]);
        let parts = stretches(&curve, |x| x, |y| y);
        assert_eq!(band_paths(&parts[0]), ["M0.0 2.0L1.0 3.0L1.0 1.0L0.0 0.0Z"]);
    }

    #[test]
    fn many_points_are_thinned_without_losing_peaks() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i) / 200.0, 0.0)).collect();
        points[54_321].1 = 9.0;
        let parts = stretches(&Curve::new("a", points), |x| x, |y| y);
        assert!(parts[0].len() < 2500, "{}", parts[0].len());
        assert!(parts[0].iter().any(|d| d.y == 9.0));
    }

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

    #[test]
    fn lines_do_not_run_through_labels() {
        let marks = [("first label".to_owned(), 10.0), ("second".to_owned(), 30.0), ("edge".to_owned(), 399.0)];
        let placed = Mark::place(&marks, 400.0, 10.0, |x| x);
        let row = |label: &str| placed.iter().find(|m| m.label == label).map(|m| (m.row, m.label_left));
        assert_eq!(row("first label"), Some((1, false)));
        assert_eq!(row("second"), Some((0, false)));
        assert_eq!(row("edge"), Some((0, true)));
    }

    #[test]
    fn marks_that_cannot_be_drawn_are_left_out() {
        assert!(Mark::place(&[("never".to_owned(), f64::NAN)], 400.0, 10.0, |x| x).is_empty());
    }

    #[test]
    fn the_lowest_and_the_highest_value_are_the_ends() {
        assert_eq!(sparkline(&[0.0, 1.0, 7.0, f64::NAN, 3.6], 80), "▁▂█ ▅");
        assert_eq!(sparkline(&[0.0, 2.0, 6.0, 8.0, 8.0], 3), "▁▇█", "means of 1, 7 and 8");
        assert_eq!(sparkline(&[5.0, 5.0], 80), "▁▁");
        assert_eq!(sparkline(&[], 80), "");
        assert_eq!(sparkline(&[f64::INFINITY], 0), " ");
    }
}

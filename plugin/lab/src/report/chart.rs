//! Data of a line chart.

use super::axis::is_drawable;

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
    pub(super) fn gaps(&self) -> usize {
        self.points.iter().filter(|p| !is_point(p)).count()
    }

    /// Returns whether nothing can be drawn.
    pub(super) fn is_blank(&self) -> bool {
        self.gaps() == self.points.len()
    }
}

/// Returns whether a point can be drawn.
pub(super) fn is_point(&(x, y): &(f64, f64)) -> bool {
    is_drawable(x) && is_drawable(y)
}

/// A line chart.
///
/// ```
/// use playbot_lab::report::{Chart, Curve};
///
/// let chart = Chart {
///     title: "Return on held-out levels".into(),
///     x_label: "environment steps".into(),
///     y_label: "episodic return".into(),
///     curves: vec![Curve::new("SCORE-PPO", vec![(0.0, 2.1), (1e6, 7.9), (2e6, 9.4)])],
///     y_range: None,
///     marks: vec![("policy starts to change".into(), 2e5)],
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
}

impl Chart {
    /// Returns the notes about values that are missing from the picture.
    pub(super) fn footnotes(&self) -> Vec<String> {
        let mut notes = Vec::new();
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

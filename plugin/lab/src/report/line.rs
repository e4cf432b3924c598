//! SVG paths of a curve: gaps, bands, and no more points than pixels.

use std::fmt::Write;

use super::chart::{Curve, is_point};

/// A point on the drawing, in pixels, with its band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Dot {
    pub x: f64,
    pub y: f64,
    /// Lower and upper end of the band.
    pub band: Option<(f64, f64)>,
}

/// Returns the stretches of a curve without gaps, in pixels, thinned to visible differences. Each point of a scatter
/// is a stretch.
pub(super) fn stretches(curve: &Curve, x: impl Fn(f64) -> f64, y: impl Fn(f64) -> f64) -> Vec<Vec<Dot>> {
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
pub(super) fn line_path(dots: &[Dot]) -> String {
    let mut path = String::new();
    for (i, dot) in dots.iter().enumerate() {
        let _ = write!(path, "{}{:.1} {:.1}", if i == 0 { "M" } else { "L" }, dot.x, dot.y);
    }
    path
}

/// Returns the `d` attributes of the areas between the ends of the bands.
pub(super) fn band_paths(dots: &[Dot]) -> Vec<String> {
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
}

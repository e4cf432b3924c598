//! Layout of the labels of vertical marks: above the plot, in as few rows as possible.

use super::axis::is_drawable;
use super::text_width::text_width;

/// A mark with its position in the drawing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Mark {
    pub label: String,
    /// Position of the line in pixels.
    pub x: f64,
    /// Row of the label, 0 just above the plot.
    pub row: usize,
    /// True if the label is left of the line, for lack of room at its right.
    pub label_left: bool,
}

/// A mark, with the ends of its label.
struct PlacedMark {
    mark: Mark,
    start: f64,
    end: f64,
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

#[cfg(test)]
mod tests {
    use super::*;

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
}

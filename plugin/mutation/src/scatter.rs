//! Scatter plots as a drawing, for pixel images.

use bevy::math::{Rect, Vec2};
use playbot_harness::drawing::{Drawing, MarkForm, Rgb, Shape};
use playbot_report::{
    chart::{Axis, Chart, is_point},
    number::tick_labels,
    text_table::text_width,
};

/// Width of the paper, and height of a plot without its labels, in pixels.
const WIDTH: f32 = 720.0;

const PLOT: f32 = 250.0;

/// Space around everything.
const MARGIN: f32 = 16.0;

/// Space for the labels of the y axis.
const LEFT: f32 = 80.0;

const LINE: f32 = 18.0;

const SIZE: f32 = 13.0;

const TITLE: f32 = 16.0;

const DOT: f32 = 4.0;

const INK: Rgb = [31, 35, 40];

const SOFT: Rgb = [87, 96, 106];

const GRID: Rgb = [222, 226, 230];

const PAPER: Rgb = [255, 255, 255];

/// The colours of the other charts' lines.
const DOTS: [Rgb; 7] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [178, 82, 155], [201, 133, 0], [58, 155, 220], [91, 91, 91]];

/// Draws the dots of charts on white paper, one chart below the other, with lines for curves that are not scatters.
/// Bands are left out.
pub fn draw_scatters(charts: &[Chart]) -> Drawing {
    let titles: Vec<&str> = charts.iter().map(|chart| chart.title.as_str()).collect();
    let (mut shapes, mut top) = (Vec::new(), MARGIN);
    for chart in charts {
        top = draw(chart, top, &mut shapes) + MARGIN;
    }
    Drawing { label: titles.join("; "), size: Vec2::new(WIDTH, top.max(2.0 * MARGIN)), shapes }
}

/// Draws a chart from this height on, and returns its lower end.
fn draw(chart: &Chart, top: f32, shapes: &mut Vec<Shape>) -> f32 {
    let points = || chart.curves.iter().flat_map(|curve| curve.points.iter().copied()).filter(is_point);
    let wanted = chart.y_range.into_iter().flat_map(|(low, high)| [low, high]);
    let x = Axis::rounded(points().map(|point| point.0), 6);
    let y = Axis::rounded(points().map(|point| point.1).chain(wanted), 5);

    text(shapes, Vec2::new(MARGIN, top + TITLE), TITLE, INK, &chart.title);
    text(shapes, Vec2::new(MARGIN, top + TITLE + LINE), SIZE, SOFT, &chart.y_label);
    let area = {
        let from = Vec2::new(MARGIN + LEFT, top + TITLE + 1.5 * LINE);
        Rect::from_corners(from, Vec2::new(WIDTH - 2.0 * MARGIN, from.y + PLOT))
    };
    let across = |value: f64| area.min.x + x.place(value) as f32 * area.width();
    let up = |value: f64| area.max.y - y.place(value) as f32 * area.height();

    for (tick, label) in y.ticks.iter().zip(tick_labels(&y.ticks, y.step)) {
        let at = up(*tick);
        line(shapes, Vec2::new(area.min.x, at), Vec2::new(area.max.x, at), GRID);
        text(shapes, Vec2::new(area.min.x - 8.0 - width(&label), at + 4.5), SIZE, SOFT, &label);
    }
    for (tick, label) in x.ticks.iter().zip(tick_labels(&x.ticks, x.step)) {
        let at = across(*tick);
        line(shapes, Vec2::new(at, area.max.y), Vec2::new(at, area.max.y + 5.0), SOFT);
        text(shapes, Vec2::new(at - width(&label) / 2.0, area.max.y + 19.0), SIZE, SOFT, &label);
    }
    line(shapes, Vec2::new(area.min.x, area.max.y), area.max, SOFT);
    let mut below = area.max.y + 19.0 + LINE;
    text(shapes, Vec2::new(area.max.x - width(&chart.x_label), below), SIZE, SOFT, &chart.x_label);

    // The first one is the subject: it is drawn last, above the others.
    for (index, curve) in chart.curves.iter().enumerate().rev() {
        if !curve.is_scatter {
            let points = curve.points.iter().copied().filter(is_point);
            let points = points.map(|(right, high)| Vec2::new(across(right), up(high))).collect();
            shapes.push(joined(points, index));
            continue;
        }
        for (right, high) in curve.points.iter().copied().filter(is_point) {
            shapes.push(dot(Vec2::new(across(right), up(high)), index));
        }
    }
    for (index, curve) in chart.curves.iter().enumerate() {
        below += LINE;
        let key = Vec2::new(area.min.x + DOT, below - 4.5);
        let reach = Vec2::new(2.0 * DOT, 0.0);
        shapes.push(if curve.is_scatter { dot(key, index) } else { joined(vec![key - reach, key + reach], index) });
        text(shapes, Vec2::new(area.min.x + 4.0 * DOT, below), SIZE, INK, &curve.label);
    }
    below
}

fn dot(centre: Vec2, index: usize) -> Shape {
    Shape::Mark { form: MarkForm::Disc, centre, radius: DOT, fill: DOTS[index % DOTS.len()], outline: PAPER }
}

fn joined(points: Vec<Vec2>, index: usize) -> Shape {
    Shape::Line { points, width: 1.5, colour: DOTS[index % DOTS.len()], opacity: 0.6 }
}

fn line(shapes: &mut Vec<Shape>, from: Vec2, to: Vec2, colour: Rgb) {
    shapes.push(Shape::Line { points: vec![from, to], width: 1.0, colour, opacity: 1.0 });
}

fn text(shapes: &mut Vec<Shape>, at: Vec2, size: f32, colour: Rgb, words: &str) {
    shapes.push(Shape::Text { at, size, colour, words: words.to_owned() });
}

fn width(words: &str) -> f32 {
    text_width(words, f64::from(SIZE)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_report::Curve;

    fn chart() -> Chart {
        let bots = Curve::scatter("bots", vec![(0.0, 0.0), (10.0, 1.0), (f64::NAN, 0.5)]);
        let others = Curve::scatter("others", vec![(5.0, 0.5)]);
        Chart {
            title: "Deaths".to_owned(),
            x_label: "people".to_owned(),
            y_label: "testers".to_owned(),
            curves: vec![bots, others],
            y_range: Some((0.0, 1.0)),
            ..Chart::default()
        }
    }

    fn dots(drawing: &Drawing, colour: Rgb) -> Vec<Vec2> {
        let centre = |shape: &Shape| match shape {
            Shape::Mark { centre, fill, .. } if *fill == colour => Some(*centre),
            _ => None,
        };
        drawing.shapes.iter().filter_map(centre).collect()
    }

    #[test]
    fn dots_lie_where_their_numbers_are_and_have_a_legend() {
        let drawing = draw_scatters(&[chart()]);
        let (bots, others) = (dots(&drawing, DOTS[0]), dots(&drawing, DOTS[1]));
        assert_eq!((bots.len(), others.len()), (3, 2), "two points and one in the legend; what is no number is none");
        assert!(bots[0].x < bots[1].x && bots[0].y > bots[1].y);
        assert!((others[0] - bots[0].midpoint(bots[1])).length() < 0.5, "half-way between");
        let words =
            |text: &str| drawing.shapes.iter().any(|it| matches!(it, Shape::Text { words, .. } if words == text));
        assert!(["Deaths", "people", "testers", "bots", "others", "10"].into_iter().all(words), "{drawing:?}");
        let paper = Rect::from_corners(Vec2::ZERO, drawing.size);
        assert!(bots.iter().chain(&others).all(|dot| paper.contains(*dot)));
    }

    #[test]
    fn a_line_among_dots_is_drawn_as_one() {
        let mut chart = chart();
        let dots_before = dots(&draw_scatters(std::slice::from_ref(&chart)), DOTS[2]).len();
        chart.curves.push(Curve::new("equal", vec![(0.0, 0.0), (1.0, 1.0)]));
        let drawing = draw_scatters(&[chart]);
        let is_one = |shape: &&Shape| matches!(shape, Shape::Line { colour, .. } if *colour == DOTS[2]);
        assert_eq!(drawing.shapes.iter().filter(is_one).count(), 2, "in the plot and in the legend");
        assert_eq!((dots_before, dots(&drawing, DOTS[2]).len()), (0, 0));
    }

    #[test]
    fn several_charts_lie_below_each_other() {
        let (one, two) = (draw_scatters(&[chart()]), draw_scatters(&[chart(), chart()]));
        assert!(two.size.y > 1.8 * one.size.y && two.size.x == one.size.x);
        assert_eq!((two.label.as_str(), two.shapes.len()), ("Deaths; Deaths", 2 * one.shapes.len()));
        assert!(draw_scatters(&[]).shapes.is_empty());
    }
}

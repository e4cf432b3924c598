//! Shapes on a sheet of paper, written as SVG or painted as pixels.

use bevy::math::{Rect, Vec2};
use playbot_report::escape::escape;
use std::fmt::Write;

/// Red, green, blue.
pub type Rgb = [u8; 3];

/// White paper with shapes on it, the first one at the bottom.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    /// A description for screen readers.
    pub label: String,
    /// Width and height, pixels.
    pub size: Vec2,
    /// The shapes. Lengths in pixels, x to the right, y down, (0, 0) in the upper left corner.
    pub shapes: Vec<Shape>,
}

/// A shape.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A filled rectangle.
    Block {
        /// Its area.
        area: Rect,
        /// Its colour.
        fill: Rgb,
    },
    /// A line through points.
    Line {
        /// The points, in order.
        points: Vec<Vec2>,
        /// Its width.
        width: f32,
        /// Its colour.
        colour: Rgb,
        /// From 0, invisible, to 1, opaque.
        opacity: f32,
    },
    /// A round or square mark with an outline.
    Mark {
        /// Its form.
        form: MarkForm,
        /// Its middle.
        centre: Vec2,
        /// Distance from its middle to its border, or to its corners.
        radius: f32,
        /// Its colour.
        fill: Rgb,
        /// Colour of its outline.
        outline: Rgb,
    },
    /// One line of text.
    Text {
        /// Left end of the baseline.
        at: Vec2,
        /// Font size.
        size: f32,
        /// Its colour.
        colour: Rgb,
        /// The text.
        words: String,
    },
}

/// The form of a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkForm {
    /// A circle.
    Disc,
    /// A square on its corner.
    Diamond,
}

impl Drawing {
    /// Returns a complete SVG file: text as text, no fonts or scripts.
    pub fn to_svg(&self) -> String {
        let (Vec2 { x: width, y: height }, label) = (self.size, escape(&self.label));
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
             height=\"{height:.0}\" role=\"img\" aria-label=\"{label}\" font-family=\"system-ui, 'Segoe UI', Roboto, \
             'DejaVu Sans', sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
        );
        for shape in &self.shapes {
            shape.write(&mut svg);
        }
        svg + "</svg>\n"
    }

    /// Puts another drawing to the right of this one.
    #[must_use]
    pub fn beside(mut self, other: Self) -> Self {
        let by = Vec2::new(self.size.x, 0.0);
        self.shapes.extend(other.shapes.into_iter().map(|shape| shape.moved(by)));
        let label = format!("{}; {}", self.label, other.label);
        Self { label, size: Vec2::new(by.x + other.size.x, self.size.y.max(other.size.y)), shapes: self.shapes }
    }
}

impl Shape {
    /// Moves it by so many pixels.
    fn moved(mut self, by: Vec2) -> Self {
        match &mut self {
            Self::Block { area, .. } => *area = Rect::from_corners(area.min + by, area.max + by),
            Self::Line { points, .. } => points.iter_mut().for_each(|point| *point += by),
            Self::Mark { centre, .. } => *centre += by,
            Self::Text { at, .. } => *at += by,
        }
        self
    }

    fn write(&self, out: &mut String) {
        // Writing into a string cannot fail.
        let _ = match self {
            Self::Block { area, fill } => writeln!(
                out,
                "<rect x=\"{:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{:.2}\" fill=\"{}\" shape-rendering=\"crispEdges\"/>",
                area.min.x,
                area.min.y,
                area.width(),
                area.height(),
                hex(*fill)
            ),
            Self::Line { points, width, colour, opacity } => writeln!(
                out,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" stroke-opacity=\"{opacity}\" \
                 stroke-linejoin=\"round\" stroke-linecap=\"round\"/>",
                list(points),
                hex(*colour)
            ),
            Self::Mark { form: MarkForm::Disc, centre, radius, fill, outline } => writeln!(
                out,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\" fill=\"{}\" stroke=\"{}\" stroke-width=\"1.5\"/>",
                centre.x,
                centre.y,
                hex(*fill),
                hex(*outline)
            ),
            Self::Mark { form: MarkForm::Diamond, centre, radius, fill, outline } => writeln!(
                out,
                "<polygon points=\"{}\" fill=\"{}\" stroke=\"{}\" stroke-width=\"1.5\"/>",
                list(&[Vec2::X, Vec2::Y, Vec2::NEG_X, Vec2::NEG_Y].map(|way| *centre + way * *radius)),
                hex(*fill),
                hex(*outline)
            ),
            Self::Text { at, size, colour, words } => writeln!(
                out,
                "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"{size}\" fill=\"{}\">{}</text>",
                at.x,
                at.y,
                hex(*colour),
                escape(words)
            ),
        };
    }
}

fn hex([red, green, blue]: Rgb) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

fn list(points: &[Vec2]) -> String {
    let words: Vec<_> = points.iter().map(|point| format!("{:.1},{:.1}", point.x, point.y)).collect();
    words.join(" ")
}

//! The pixels of a picture, and the position of the world's objects on them.

use std::ops::Range;

use bevy::prelude::*;

use super::{colour::Rgba, quad::Quad};

/// The view of a sensor: the map from coordinates of the world to pixels, with y down and (0, 0)
/// the top left corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    centre: Vec2,
    middle: Vec2,
    pixels_per_unit: f32,
}

impl View {
    /// Creates a view of `width` units of the world around `centre`, on a picture of this size in
    /// pixels.
    pub fn new(centre: Vec2, width: f32, size: UVec2) -> Self {
        Self { centre, middle: size.as_vec2() / 2.0, pixels_per_unit: size.x as f32 / width }
    }

    /// Returns the position of an object on the picture.
    pub fn place(&self, quad: &Quad) -> Quad {
        let along = |way: Vec2| Vec2::new(way.x * self.pixels_per_unit, -way.y * self.pixels_per_unit);
        Quad { corner: along(quad.corner - self.centre) + self.middle, across: along(quad.across), up: along(quad.up) }
    }
}

/// A picture that is being painted.
pub(super) struct Canvas<'a> {
    /// `[height, width]`.
    pub pixels: &'a mut [Rgba],
    pub width: usize,
    pub height: usize,
}

impl Canvas<'_> {
    /// Returns the columns and rows of the pixels that a quad may cover.
    pub fn cut(&self, quad: &Quad) -> (Range<usize>, Range<usize>) {
        let side = |corner: f32, a: f32, b: f32, limit| {
            let (least, most) = (a.min(0.0) + b.min(0.0), a.max(0.0) + b.max(0.0));
            covered(corner + least, corner + most, limit)
        };
        let Quad { corner, across, up } = *quad;
        (side(corner.x, across.x, up.x, self.width), side(corner.y, across.y, up.y, self.height))
    }

    /// Returns a part of a row.
    pub fn row(&mut self, y: usize, columns: &Range<usize>) -> &mut [Rgba] {
        let from = y * self.width;
        &mut self.pixels[from + columns.start..from + columns.end]
    }
}

/// Returns the pixels whose centre lies between two edges, the first edge included.
pub(super) fn covered(from: f32, to: f32, limit: usize) -> Range<usize> {
    // Negative numbers and NaN become 0.
    let edge = |edge: f32| ((edge - 0.5).ceil() as usize).min(limit);
    let (start, end) = (edge(from), edge(to));
    start..end.max(start)
}

/// Returns the centre of a pixel.
#[inline]
pub(super) fn centre(pixel: usize) -> f32 {
    pixel as f32 + 0.5
}

/// The map from a picture to a quad's own coordinates, 0 to 1 along its sides.
#[derive(Clone, Copy)]
pub(super) struct Inverse {
    corner: Vec2,
    across: Vec2,
    up: Vec2,
}

impl Inverse {
    /// Returns the map, or `None` for a quad without area.
    pub fn of(quad: &Quad) -> Option<Self> {
        let Quad { corner, across, up } = *quad;
        let area = across.x * up.y - across.y * up.x;
        let scale = 1.0 / area;
        let sound = area != 0.0 && scale.is_finite();
        sound.then_some(Self {
            corner,
            across: Vec2::new(up.y, -up.x) * scale,
            up: Vec2::new(-across.y, across.x) * scale,
        })
    }

    /// Returns the position of a pixel's centre, across and up.
    pub fn at(&self, x: usize, y: usize) -> Vec2 {
        let way = Vec2::new(centre(x), centre(y)) - self.corner;
        Vec2::new(way.x * self.across.x + way.y * self.across.y, way.x * self.up.x + way.y * self.up.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_covered_if_its_centre_is() {
        assert_eq!(covered(0.5, 2.5, 9), 0..2, "the first edge counts, the last does not");
        assert_eq!(covered(0.6, 2.6, 9), 1..3);
        assert_eq!(covered(-7.0, 99.0, 9), 0..9);
        for nothing in [covered(3.0, 1.0, 9), covered(20.0, 30.0, 9), covered(-9.0, -3.0, 9), covered(0.7, 1.2, 9)] {
            assert!(nothing.is_empty());
        }
        assert!(covered(f32::NAN, f32::NAN, 9).is_empty());
    }

    #[test]
    fn the_inverse_goes_back() {
        let quad = Quad { corner: Vec2::new(3.0, 9.0), across: Vec2::new(4.0, 1.0), up: Vec2::new(2.0, -6.0) };
        let inverse = Inverse::of(&quad).expect("it has an area");
        for (x, y) in [(0, 0), (3, 8), (7, 5)] {
            let at = inverse.at(x, y);
            let back = quad.corner + quad.across * at.x + quad.up * at.y;
            assert!((back - Vec2::new(x as f32 + 0.5, y as f32 + 0.5)).length() < 1e-5, "{back}");
        }
        assert!(Inverse::of(&Quad { across: quad.up, ..quad }).is_none());
    }
}

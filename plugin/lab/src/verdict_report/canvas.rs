//! Canvas of pixels in a few colours.

use bevy::math::Rect;

use crate::drawing::Rgb;

/// All colours. The first one is transparent, all others are visible on light and on dark paper.
pub const PALETTE: [Rgb; 7] =
    [[255, 255, 255], [128, 136, 146], [176, 148, 98], [204, 82, 70], [86, 150, 200], [230, 120, 0], [0, 158, 115]];

/// A colour of the palette.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    Paper,
    Wall,
    Platform,
    Hazard,
    Trail,
    Agent,
    Goal,
}

/// A picture, row by row from the top.
pub struct Canvas {
    pub width: usize,
    pub height: usize,
    pixels: Vec<u8>,
}

impl Canvas {
    /// Makes empty paper.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![Colour::Paper as u8; width * height] }
    }

    /// Fills the pixels whose middle lies in an area, and at least one.
    pub fn area(&mut self, area: Rect, colour: Colour) {
        if !(area.min.is_finite() && area.max.is_finite()) {
            return;
        }
        let edge = |at: f32, most: usize| at.round().clamp(0.0, most as f32) as usize;
        let (left, top) = (edge(area.min.x, self.width), edge(area.min.y, self.height));
        let (right, bottom) = (edge(area.max.x, self.width), edge(area.max.y, self.height));
        let is_seen = area.max.min_element() > 0.0 && left < self.width && top < self.height;
        if is_seen {
            self.block([left, top, right.max(left + 1), bottom.max(top + 1)], colour);
        }
    }

    /// Fills the pixels between left, top, right and bottom, which lie on the canvas.
    pub fn block(&mut self, [left, top, right, bottom]: [usize; 4], colour: Colour) {
        for row in top..bottom {
            self.pixels[row * self.width + left..row * self.width + right].fill(colour as u8);
        }
    }

    /// Returns the pixels of a part, two to a byte; each row begins with a new one.
    pub fn packed(&self, [left, top, right, bottom]: [usize; 4]) -> Vec<u8> {
        let rows = (top..bottom).map(|row| &self.pixels[row * self.width + left..row * self.width + right]);
        rows.flat_map(|row| row.chunks(2).map(|pair| (pair[0] << 4) | pair.get(1).copied().unwrap_or(0))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_clipped_and_rows_are_padded() {
        let mut canvas = Canvas::new(3, 2);
        canvas.area(Rect::new(-5.0, 1.0, 2.0, 9.0), Colour::Wall);
        canvas.area(Rect::new(2.2, 0.1, 2.3, 0.2), Colour::Goal);
        for outside in [Rect::new(3.0, 0.0, 4.0, 1.0), Rect::new(-4.0, 0.0, -1.0, 2.0)] {
            canvas.area(outside, Colour::Hazard);
        }
        canvas.area(Rect { min: bevy::math::Vec2::NAN, max: bevy::math::Vec2::ONE }, Colour::Hazard);
        assert_eq!(canvas.packed([0, 0, 3, 2]), [0x00, 0x60, 0x11, 0x00]);
        assert_eq!(canvas.packed([2, 0, 3, 1]), [0x60]);
    }
}

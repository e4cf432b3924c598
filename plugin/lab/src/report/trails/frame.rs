//! Position of a floor on the paper.

use bevy::math::{Rect, Vec2};

/// A floor on the paper: converts its units to pixels, with y turned around.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    bounds: Rect,
    corner: Vec2,
    scale: f32,
}

impl Frame {
    /// Makes a floor with its upper left corner here, this wide.
    pub fn new(bounds: Rect, corner: Vec2, width: f32) -> Self {
        Self { bounds, corner, scale: width / bounds.width().max(f32::MIN_POSITIVE) }
    }

    /// Returns the drawn part of the floor, in its units.
    pub fn bounds(&self) -> Rect {
        self.bounds
    }

    /// Returns the pixel of a position on the floor.
    pub fn place(&self, at: Vec2) -> Vec2 {
        self.corner + Vec2::new(at.x - self.bounds.min.x, self.bounds.max.y - at.y) * self.scale
    }

    /// Returns the pixels of an area of the floor, cut at the bounds.
    pub fn area(&self, area: Rect) -> Rect {
        let seen = area.intersect(self.bounds);
        Rect::from_corners(self.place(seen.min), self.place(seen.max))
    }

    /// Returns the pixels of the whole floor.
    pub fn whole(&self) -> Rect {
        self.area(self.bounds)
    }
}

//! The drawing of the puffs that enemies leave behind: translucent white discs, side by side, made in code.
//!
//! An enemy leaves a puff in every tick. Each rises, grows and fades, and is gone after [`PUFFS`] ticks. Those of ticks
//! in which it walked at one speed are drawn as one. Many overlapping sprites would take the raster many times as long,
//! for the same picture.

use bevy::{image::ImageSampler, prelude::*};

/// Visible puffs of an enemy, and ticks for which each is visible.
pub(crate) const PUFFS: usize = 8;

/// Half of the width and of the height of a new puff, tiles, and the factor by which it grows in each tick.
const NEW: Vec2 = Vec2::new(0.3, 0.2);

const GROWTH: f32 = 1.05;

/// Opacity of a new puff, and the factor by which it fades.
const ALPHA: f32 = 0.5;

const FADING: f32 = 0.8;

/// Tiles by which a puff rises in each tick.
const RISE: f32 = 0.01;

/// Tiles between two puffs of the drawing: enemies walk as fast as this until they turn at inner ground.
const STEP: f32 = 0.15;

/// Distance from the middle of a new puff to the upper edge of the drawing, and height of the drawing, tiles.
const TOP: f32 = 0.35;

const HEIGHT: f32 = 0.5625;

/// Texels to the tile.
const TEXELS: f32 = 16.0;

/// Texels of the cell of each row of puffs.
const CELL: (u32, u32) = (32, 10);

/// Puffs of ticks in a row: the newest is `first` ticks old, and there are `count` of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PuffRow {
    /// Age of the newest.
    pub first: usize,
    /// Number of puffs, at least 1; all are younger than [`PUFFS`] ticks.
    pub count: usize,
}

/// Returns half of the width and height of a puff of this age.
fn half_size(age: usize) -> Vec2 {
    (0..age).fold(NEW, |half, _| half * GROWTH)
}

impl PuffRow {
    fn last(self) -> usize {
        self.first + self.count - 1
    }

    /// Returns the width of the row if the enemy went `walked` tiles between its newest and its oldest puff.
    pub fn width(self, walked: f32) -> f32 {
        walked + half_size(self.first).x + half_size(self.last()).x
    }

    /// Returns size and middle of its sprite, tiles, if the enemy went from `oldest` to `newest` meanwhile. Both are
    /// positions of new puffs.
    pub fn lay_out(self, newest: Vec2, oldest: Vec2) -> (Vec2, Vec2) {
        let walked = newest.x - oldest.x;
        let width = self.width(walked.abs());
        // One of the ends of the row, and the direction from there to its middle.
        let (edge, way) = if walked < 0.0 { (-1.0, 0.5) } else { (1.0, -0.5) };
        let x = newest.x + edge * half_size(self.first).x + way * width;
        (Vec2::new(width, HEIGHT), Vec2::new(x, newest.y + TOP - HEIGHT / 2.0))
    }

    /// Returns its cell on the drawing, where it walks to the right.
    pub fn rect(self) -> Rect {
        let (x, y) = ((self.count as u32 - 1) * CELL.0, self.first as u32 * CELL.1);
        let corner = UVec2::new(x, y).as_vec2();
        let width = self.width(STEP * (self.count - 1) as f32);
        Rect::from_corners(corner, corner + Vec2::new(width, HEIGHT) * TEXELS)
    }

    /// Returns its opacity at a position right of its left end and above the middle of a new puff, tiles.
    fn alpha(self, at: Vec2) -> f32 {
        let (left, mut through) = (half_size(self.last()).x, 1.0);
        let mut alpha = (0..self.first).fold(ALPHA, |alpha, _| alpha * FADING);
        for age in self.first..=self.last() {
            let middle = Vec2::new(left + STEP * (self.last() - age) as f32, RISE * age as f32);
            if ((at - middle) / half_size(age)).length_squared() <= 1.0 {
                through *= 1.0 - alpha;
            }
            alpha *= FADING;
        }
        1.0 - through
    }
}

/// Returns all rows of puffs.
pub(crate) fn drawing() -> Image {
    let (width, height) = (PUFFS as u32 * CELL.0, PUFFS as u32 * CELL.1);
    let texel = |x: u32, y: u32| {
        let row = PuffRow { first: (y / CELL.1) as usize, count: (x / CELL.0) as usize + 1 };
        let place = Vec2::new((x % CELL.0) as f32 + 0.5, (y % CELL.1) as f32 + 0.5) / TEXELS;
        let alpha = if row.last() < PUFFS { row.alpha(Vec2::new(place.x, TOP - place.y)) } else { 0.0 };
        [255, 255, 255, (alpha * 255.0 + 0.5) as u8]
    };
    // The type of an image's size has no name in a program without a renderer.
    let mut image = Image::default();
    image.texture_descriptor.size.width = width;
    image.texture_descriptor.size.height = height;
    image.data = Some((0..height).flat_map(|y| (0..width).flat_map(move |x| texel(x, y))).collect());
    image.sampler = ImageSampler::nearest();
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alpha(image: &Image, at: Vec2) -> u8 {
        image.pixel_bytes(at.as_uvec2().extend(0)).expect("on the drawing")[3]
    }

    #[test]
    fn puffs_fade_and_overlap() {
        let image = drawing();
        let mut faded = 127.5;
        for first in 0..PUFFS {
            let single = PuffRow { first, count: 1 }.rect();
            assert!((f32::from(alpha(&image, single.center())) - faded).abs() <= 1.0, "age {first}");
            assert_eq!(alpha(&image, single.min), 0, "round");
            faded *= 0.8;
        }
        let all = PuffRow { first: 0, count: PUFFS }.rect();
        let at = |x: f32| alpha(&image, Vec2::new(x, all.min.y + TOP * TEXELS));
        // Middle of the newest: 0.3 + 8 of its own 0.6 wide, under it those of the two ticks before.
        let expected = 255.0 * (1.0 - 0.5 * 0.6 * 0.68);
        assert!((f32::from(at(all.max.x - 0.3 * TEXELS)) - expected).abs() <= 1.0);
        assert!((1..60).contains(&at(all.min.x + 2.0)), "the oldest is hardly to be seen");
    }

    #[test]
    fn every_row_lies_in_its_place() {
        for first in 0..PUFFS {
            for count in 1..=PUFFS - first {
                let Vec2 { x, y } = PuffRow { first, count }.rect().size();
                assert!(x <= CELL.0 as f32 && y <= CELL.1 as f32, "{first}, {count}: {x} x {y}");
            }
        }
    }

    #[test]
    fn a_row_reaches_from_its_oldest_to_its_newest_puff() {
        let row = PuffRow { first: 1, count: 3 };
        let (newest, old) = (0.3 * 1.05, 0.3 * 1.05 * 1.05 * 1.05);
        let right = row.lay_out(Vec2::new(5.0, 2.0), Vec2::new(4.7, 2.0));
        assert!((right.1.x + right.0.x / 2.0 - (5.0 + newest)).abs() < 1e-5);
        assert!((right.1.x - right.0.x / 2.0 - (4.7 - old)).abs() < 1e-5);
        let left = row.lay_out(Vec2::new(4.7, 2.0), Vec2::new(5.0, 2.0));
        assert!((left.1.x - left.0.x / 2.0 - (4.7 - newest)).abs() < 1e-5);
        assert!((left.1.x + left.0.x / 2.0 - (5.0 + old)).abs() < 1e-5);
    }
}

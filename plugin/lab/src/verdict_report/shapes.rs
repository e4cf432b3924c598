//! Shapes of a floor on a grid of whole numbers, and short SVG paths around them.

use std::fmt::Write;

use bevy::math::{Rect, Vec2};

/// Units of the grid along the longer side of a floor.
const LENGTH: f32 = 640.0;

/// A floor on the grid: x to the right, y down.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    extent: Rect,
    scale: f32,
}

/// A rectangle on the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Block {
    pub left: i32,
    pub right: i32,
    pub top: i32,
    pub bottom: i32,
}

impl Grid {
    /// Makes a grid for this part of a floor; `None` for one without extent.
    pub fn new(extent: Rect) -> Option<Self> {
        let longer = extent.size().max_element();
        let is_there = extent.min.is_finite() && extent.max.is_finite() && longer.is_finite() && longer > 0.0;
        is_there.then(|| Self { extent, scale: LENGTH / longer })
    }

    /// Returns width and height.
    pub fn size(&self) -> [i32; 2] {
        let size = (self.extent.size() * self.scale).round().max(Vec2::ONE);
        [size.x as i32, size.y as i32]
    }

    /// Returns the grid point of a position; those beyond the floor are on its border. `None` if it is not finite.
    pub fn place(&self, at: Vec2) -> Option<[i32; 2]> {
        let at = at.is_finite().then(|| at.max(self.extent.min).min(self.extent.max))?;
        let Rect { min, max } = self.extent;
        let place = (Vec2::new(at.x - min.x, max.y - at.y) * self.scale).round();
        Some([place.x as i32, place.y as i32])
    }

    /// Returns the block of an area, at least one unit each way; `None` for areas beyond the floor.
    pub fn block(&self, area: Rect) -> Option<Block> {
        let seen = area.intersect(self.extent);
        if seen.is_empty() {
            return None;
        }
        let ([left, bottom], [right, top]) = (self.place(seen.min)?, self.place(seen.max)?);
        Some(Block { left, right: right.max(left + 1), top, bottom: bottom.max(top + 1) })
    }
}

/// Merges blocks of the same width that stand on each other.
pub fn stacked(mut blocks: Vec<Block>) -> Vec<Block> {
    blocks.sort_unstable();
    let mut joined: Vec<Block> = Vec::new();
    for block in blocks {
        match joined.last_mut() {
            Some(last) if (last.left, last.right) == (block.left, block.right) && block.top <= last.bottom => {
                last.bottom = last.bottom.max(block.bottom);
            }
            _ => joined.push(block),
        }
    }
    joined
}

/// Returns the path around blocks.
pub fn path(blocks: &[Block]) -> String {
    let mut path = String::new();
    for Block { left, right, top, bottom } in blocks {
        let (width, height) = (right - left, bottom - top);
        // Writing into a string cannot fail.
        let _ = write!(path, "M{left} {top}h{width}v{height}h-{width}z");
    }
    path
}

/// Adds a path in the colour of a class with this opacity; nothing for an empty path.
pub fn shape(class: &str, strength: Option<&str>, path: &str, svg: &mut String) {
    if path.is_empty() {
        return;
    }
    let opacity = strength.map_or_else(String::new, |strength| format!(" opacity=\"{strength}\""));
    let _ = write!(svg, "<path class=\"{class}\"{opacity} d=\"{path}\"/>");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_lie_on_whole_numbers_with_the_lowest_below() {
        let grid = Grid::new(Rect::new(-2.0, 0.0, 62.0, 32.0)).expect("it has an extent");
        assert_eq!(grid.size(), [640, 320]);
        assert_eq!(grid.place(Vec2::new(-2.0, 32.0)), Some([0, 0]));
        assert_eq!(grid.place(Vec2::new(1e30, -7.0)), Some([640, 320]));
        assert_eq!(grid.place(Vec2::new(f32::NAN, 0.0)), None);
        let floor = grid.block(Rect::new(-9.0, 0.0, 0.0, 1.0)).expect("it is seen");
        assert_eq!(floor, Block { left: 0, right: 20, top: 310, bottom: 320 });
        assert_eq!(path(&[floor]), "M0 310h20v10h-20z");
        assert_eq!(grid.block(Rect::new(70.0, 0.0, 80.0, 1.0)), None);
        assert!(grid.block(Rect::new(3.0, 3.0, 3.001, 3.001)).is_some_and(|dot| dot.right - dot.left == 1));
        for extent in [Rect::default(), Rect::new(0.0, 0.0, f32::INFINITY, 1.0)] {
            assert!(Grid::new(extent).is_none(), "{extent:?}");
        }
    }

    #[test]
    fn a_wall_of_many_rows_is_one_block() {
        let block = |left, top| Block { left, right: left + 10, top, bottom: top + 10 };
        let joined = stacked(vec![block(0, 20), block(0, 0), block(0, 10), block(10, 0), block(0, 40)]);
        assert_eq!(joined, [Block { bottom: 30, ..block(0, 0) }, block(0, 40), block(10, 0)]);
    }
}

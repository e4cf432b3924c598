//! Grids of square cells over a level.

use bevy::math::{Rect, Vec2};

use super::cell::Cell;
use crate::floor_plan::FloorPlan;

/// Squares along the longer side of a plan without walls that would give their size.
const SQUARES: f32 = 16.0;
/// Sizes are multiples of its inverse, so that rounding in the corners of a plan's walls does not shift the grid.
const FINENESS: f32 = 1024.0;

/// A grid of square cells. The numbers of a cell are its column and row, from the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellGrid {
    /// Corner of cell 0,0 with the least x and y.
    pub origin: Vec2,
    /// Side of a cell, in the units of the plan.
    pub size: f32,
}

impl CellGrid {
    /// Creates the grid of a level: its cells are the tiles of the floor plan, unless `size` is given. Without a plan
    /// they have side 1 and start at the origin.
    pub fn new(plan: Option<&FloorPlan>, size: Option<f32>) -> Self {
        let usual = plan.map_or(1.0, |plan| {
            let even = || plan.bounds.size().max_element() / SQUARES;
            let side = tile_size(plan).unwrap_or_else(even);
            if side.is_finite() && side > 0.0 { side } else { 1.0 }
        });
        Self { origin: plan.map_or(Vec2::ZERO, |plan| plan.bounds.min), size: size.unwrap_or(usual) }
    }

    /// Returns the cell at a position; `None` for a position that is not finite.
    pub fn cell_at(&self, place: Vec2) -> Option<Cell> {
        let at = ((place - self.origin) / self.size).floor();
        place.is_finite().then(|| Cell(vec![at.x as i32, at.y as i32]))
    }

    /// Returns the area of a cell; `None` for a cell of another kind.
    pub fn area(&self, cell: &Cell) -> Option<Rect> {
        let &[column, row] = cell.0.as_slice() else { return None };
        let corner = self.origin + Vec2::new(column as f32, row as f32) * self.size;
        Some(Rect::from_corners(corner, corner + self.size))
    }
}

/// Returns the side of a plan's tiles: that of the narrowest wall.
pub(super) fn tile_size(plan: &FloorPlan) -> Option<f32> {
    let narrow = plan.walls.iter().map(|wall| wall.size().min_element());
    let side = narrow.filter(|side| side.is_finite() && *side > 0.0).min_by(f32::total_cmp)?;
    let rounded = (side * FINENESS).round() / FINENESS;
    Some(if rounded > 0.0 { rounded } else { side })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> FloorPlan {
        let square = |row: usize, column: usize| {
            Rect::from_center_size(Vec2::new(column as f32, row as f32) * 4.0 - 0.2, Vec2::splat(4.0))
        };
        FloorPlan::of_tiles([3, 5], |row, column| row != 1 || column == 0, square, [Vec2::splat(4.0), Vec2::ZERO])
    }

    #[test]
    fn cells_are_the_tiles_of_the_plan() {
        let grid = CellGrid::new(Some(&plan()), None);
        assert_eq!(grid.size, 4.0);
        assert_eq!(grid.cell_at(Vec2::new(8.0, 4.0)), Some(Cell(vec![2, 1])));
        assert_eq!(grid.cell_at(Vec2::splat(-3.0)), Some(Cell(vec![-1, -1])));
        let area = grid.area(&Cell(vec![2, 1])).expect("a square");
        assert!(area.center().distance(Vec2::new(7.8, 3.8)) < 1e-4, "{area:?}");
    }

    #[test]
    fn another_size_is_taken_and_levels_without_a_plan_have_squares_of_side_1() {
        assert_eq!(CellGrid::new(Some(&plan()), Some(0.5)).size, 0.5);
        let bare = CellGrid::new(None, None);
        assert_eq!((bare.origin, bare.size), (Vec2::ZERO, 1.0));
        assert_eq!(bare.cell_at(Vec2::new(f32::NAN, 0.0)), None);
        assert_eq!(bare.area(&Cell(vec![1, 2, 3])), None);
        let empty = FloorPlan { bounds: Rect::new(0.0, 0.0, 32.0, 8.0), ..FloorPlan::default() };
        assert_eq!(CellGrid::new(Some(&empty), None).size, 2.0);
    }
}

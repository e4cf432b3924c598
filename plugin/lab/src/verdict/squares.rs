//! The squares of a level in which events are counted.

use std::collections::BTreeSet;

use bevy::math::Vec2;

use crate::{
    explore::{Cell, CellGrid, cells_between, open_cells, reach},
    floor_plan::FloorPlan,
};

/// Most squares along the longer side of a level.
const MOST: f32 = 64.0;
/// Part of a square by which a level may be longer than its squares, through rounding.
const SLACK: f32 = 1e-3;

/// The squares of a level: its own tiles, or several of them in larger levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LevelSquares {
    pub grid: CellGrid,
    pub columns: usize,
    pub rows: usize,
    /// Largest distance of an agent's step in a tick.
    reach: f32,
}

impl LevelSquares {
    /// Returns the squares of a level; `None` for one without extent.
    pub fn of(plan: &FloorPlan) -> Option<Self> {
        let size = plan.bounds.size();
        if !(plan.bounds.min.is_finite() && size.is_finite() && size.min_element() > 0.0) {
            return None;
        }
        let tile = CellGrid::new(Some(plan), None).size;
        let side = tile * (size.max_element() / (tile * MOST) - SLACK).ceil().max(1.0);
        if !side.is_finite() {
            return None;
        }
        let count = (size / side - SLACK).ceil().max(Vec2::ONE);
        let grid = CellGrid::new(Some(plan), Some(side));
        Some(Self { grid, columns: count.x as usize, rows: count.y as usize, reach: reach(tile) })
    }

    /// Returns the number of squares.
    pub fn count(&self) -> usize {
        self.columns * self.rows
    }

    /// Returns the square around a position, counted row by row from below; `None` outside the level.
    pub fn at(&self, place: Vec2) -> Option<usize> {
        let at = (place - self.grid.origin) / self.grid.size;
        // Positions that are not numbers count as outside.
        let is_inside = at.x >= 0.0 && at.y >= 0.0 && at.x < self.columns as f32 && at.y < self.rows as f32;
        is_inside.then(|| at.y as usize * self.columns + at.x as usize)
    }

    /// Returns the squares between two positions of an agent in consecutive ticks; no squares if it has been put
    /// there.
    pub fn between(self, from: Vec2, to: Vec2) -> impl Iterator<Item = usize> {
        cells_between(self.grid, from, to, self.reach).filter_map(move |cell| self.index(cell))
    }

    /// Returns the squares that walls do not cut off from the start, if the plan has a start.
    pub fn open(&self, plan: &FloorPlan) -> Option<BTreeSet<usize>> {
        let cells = open_cells(plan, &self.grid)?;
        Some(cells.iter().filter_map(|cell| self.of_cell(cell)).collect())
    }

    fn of_cell(&self, cell: &Cell) -> Option<usize> {
        let &[column, row] = cell.0.as_slice() else { return None };
        self.index([column, row])
    }

    fn index(&self, [column, row]: [i32; 2]) -> Option<usize> {
        let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
        (column < self.columns && row < self.rows).then_some(row * self.columns + column)
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Rect;

    use super::*;

    fn plan(width: f32, height: f32, tile: f32) -> FloorPlan {
        FloorPlan {
            bounds: Rect::new(-1.0, 2.0, width - 1.0, height + 2.0),
            walls: vec![Rect::new(1.0, 2.0, 1.0 + tile, height + 2.0)],
            start: Vec2::new(-0.5, 2.5),
            ..FloorPlan::default()
        }
    }

    #[test]
    fn squares_are_tiles_counted_from_below() {
        let squares = LevelSquares::of(&plan(4.0, 3.0, 1.0)).expect("it has an extent");
        assert_eq!((squares.columns, squares.rows, squares.grid.size, squares.count()), (4, 3, 1.0, 12));
        assert_eq!(squares.at(Vec2::new(-0.9, 2.1)), Some(0));
        assert_eq!(squares.at(Vec2::new(2.5, 4.5)), Some(2 * 4 + 3));
        for outside in [Vec2::new(-1.1, 2.5), Vec2::new(3.1, 2.5), Vec2::new(0.0, 5.0), Vec2::NAN] {
            assert_eq!(squares.at(outside), None, "{outside}");
        }
        let passed = |to| squares.between(Vec2::new(-0.5, 2.5), to).collect::<Vec<_>>();
        assert_eq!(passed(Vec2::new(2.5, 2.5)), [1, 2]);
        assert!(passed(Vec2::new(3.75, 4.5)).is_empty(), "farther than four tiles");
        // The wall in the third column cuts the fourth off.
        let open = squares.open(&plan(4.0, 3.0, 1.0)).expect("the start is free");
        assert_eq!(open.into_iter().collect::<Vec<_>>(), [0, 1, 4, 5, 8, 9]);
    }

    #[test]
    fn large_levels_have_coarser_squares_and_flat_ones_none() {
        let squares = LevelSquares::of(&plan(640.0, 30.0, 1.0)).expect("it has an extent");
        assert_eq!((squares.columns, squares.rows, squares.grid.size), (64, 3, 10.0));
        assert_eq!(LevelSquares::of(&plan(0.0, 3.0, 1.0)), None);
        assert_eq!(LevelSquares::of(&plan(f32::NAN, 3.0, 1.0)), None);
    }
}

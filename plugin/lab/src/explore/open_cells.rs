//! The reachable cells of a level, by its floor plan.

use std::collections::{BTreeSet, VecDeque};

use bevy::math::Vec2;

use super::{
    cell::Cell,
    grid::{CellGrid, tile_size},
};
use crate::floor_plan::FloorPlan;

/// Most squares that are examined.
const MOST: f32 = (1 << 20) as f32;

/// Returns the cells of a grid that no wall cuts off from the start of a level; `None` if the plan is too large for
/// such squares, or its start lies in a wall.
///
/// In a maze these are exactly the reachable cells. With gravity or enemies they are a bound: no other cell is
/// reachable, and some of these may be out of reach.
pub fn open_cells(plan: &FloorPlan, grid: &CellGrid) -> Option<BTreeSet<Cell>> {
    let squares = Squares::new(plan, grid)?;
    let start = squares.index_at(plan.start).filter(|index| !squares.is_wall[*index])?;
    let mut reached = vec![false; squares.is_wall.len()];
    reached[start] = true;
    let mut queue = VecDeque::from([start]);
    let mut cells = BTreeSet::new();
    while let Some(index) = queue.pop_front() {
        let (column, row) = (index % squares.columns, index / squares.columns);
        cells.extend(grid.cell_at(squares.centre(column, row)));
        let beside =
            [(column.wrapping_sub(1), row), (column + 1, row), (column, row.wrapping_sub(1)), (column, row + 1)];
        for (column, row) in beside.into_iter().filter(|(column, row)| *column < squares.columns && *row < squares.rows)
        {
            let next = row * squares.columns + column;
            if !squares.is_wall[next] && !reached[next] {
                reached[next] = true;
                queue.push_back(next);
            }
        }
    }
    Some(cells)
}

/// A plan in squares that are as fine as its tiles, or as the cells if these are finer.
struct Squares {
    origin: Vec2,
    side: f32,
    columns: usize,
    rows: usize,
    is_wall: Vec<bool>,
}

impl Squares {
    fn new(plan: &FloorPlan, grid: &CellGrid) -> Option<Self> {
        let side = tile_size(plan).map_or(grid.size, |tile| tile.min(grid.size));
        let count = (plan.bounds.size() / side).round().max(Vec2::ONE);
        let fits = count.x * count.y <= MOST;
        if !fits {
            return None;
        }
        let (columns, rows) = (count.x as usize, count.y as usize);
        let mut squares = Self { origin: plan.bounds.min, side, columns, rows, is_wall: vec![false; columns * rows] };
        for wall in &plan.walls {
            // Those with their middle in the wall.
            let first = ((wall.min - squares.origin) / side - 0.5).ceil().max(Vec2::ZERO);
            let last = ((wall.max - squares.origin) / side - 0.5).floor();
            if last.min_element() < 0.0 {
                continue;
            }
            for row in first.y as usize..=(last.y as usize).min(rows - 1) {
                for column in first.x as usize..=(last.x as usize).min(columns - 1) {
                    squares.is_wall[row * columns + column] = true;
                }
            }
        }
        Some(squares)
    }

    fn index_at(&self, place: Vec2) -> Option<usize> {
        let at = (place - self.origin) / self.side;
        let (column, row) = (at.x as usize, at.y as usize);
        let is_inside = at.min_element() >= 0.0 && column < self.columns && row < self.rows;
        is_inside.then(|| row * self.columns + column)
    }

    fn centre(&self, column: usize, row: usize) -> Vec2 {
        self.origin + (Vec2::new(column as f32, row as f32) + 0.5) * self.side
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Rect;

    use super::*;

    /// A room of five cells, and a closed one.
    const ROWS: [&str; 5] = ["#######", "#..#..#", "#.##..#", "#..####", "#######"];

    fn plan() -> FloorPlan {
        let square =
            |row: usize, column: usize| Rect::from_center_size(Vec2::new(column as f32, row as f32) - 0.2, Vec2::ONE);
        let is_wall = |row: usize, column: usize| ROWS[row].as_bytes()[column] == b'#';
        FloorPlan::of_tiles([5, 7], is_wall, square, [Vec2::ONE, Vec2::new(2.0, 3.0)])
    }

    fn open(size: Option<f32>) -> BTreeSet<Cell> {
        let plan = plan();
        open_cells(&plan, &CellGrid::new(Some(&plan), size)).expect("a small plan")
    }

    #[test]
    fn cells_behind_walls_are_not_open() {
        let expected = [[1, 1], [1, 2], [1, 3], [2, 1], [2, 3]];
        assert_eq!(open(None), expected.map(|cell| Cell(cell.to_vec())).into_iter().collect());
    }

    #[test]
    fn finer_cells_are_counted_where_there_is_no_wall_and_coarser_ones_where_any_tile_is_open() {
        assert_eq!(open(Some(0.5)).len(), 4 * 5);
        // Columns 0 and 1 of two tiles each, rows 0 and 1.
        assert_eq!(open(Some(2.0)).len(), 4);
    }

    #[test]
    fn a_start_in_a_wall_says_nothing() {
        let plan = FloorPlan { start: Vec2::ZERO, ..plan() };
        assert_eq!(open_cells(&plan, &CellGrid::new(Some(&plan), None)), None);
        assert_eq!(open_cells(&plan, &CellGrid::new(Some(&plan), Some(1e-6))), None, "too many squares");
    }
}

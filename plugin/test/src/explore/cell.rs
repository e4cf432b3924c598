//! The cells of an exploration: groups of states that count as the same.

use bevy::{
    math::{Rect, Vec2},
    prelude::*,
};
use bevy_playbot::observation::Observation;
use playbot_harness::{floor_plan::FloorPlan, game::Game};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeSet, fmt, str::FromStr};
use thiserror::Error;

/// A group of states that count as the same: a square of a grid, the game's own cell, or similar observations.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ExploredCell(pub Vec<i32>);

/// The text is not a cell.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("`{0}` is not a cell: write its numbers as they are printed, separated by commas, such as 3,4")]
pub struct NoCell(pub String);

impl fmt::Display for ExploredCell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<_> = self.0.iter().map(ToString::to_string).collect();
        f.write_str(&words.join(","))
    }
}

impl FromStr for ExploredCell {
    type Err = NoCell;

    fn from_str(text: &str) -> Result<Self, NoCell> {
        let numbers: Result<Vec<i32>, _> = text.split(',').map(|word| word.trim().parse()).collect();
        numbers.map(Self).map_err(|_| NoCell(text.to_owned()))
    }
}

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
        let default = plan.map_or(1.0, |plan| {
            let even = || plan.bounds.size().max_element() / SQUARES;
            let side = tile_size(plan).unwrap_or_else(even);
            if side.is_finite() && side > 0.0 { side } else { 1.0 }
        });
        Self { origin: plan.map_or(Vec2::ZERO, |plan| plan.bounds.min), size: size.unwrap_or(default) }
    }

    /// Returns the cell at a position; `None` for a position that is not finite.
    pub fn cell_at(&self, position: Vec2) -> Option<ExploredCell> {
        let at = ((position - self.origin) / self.size).floor();
        position.is_finite().then(|| ExploredCell(vec![at.x as i32, at.y as i32]))
    }

    /// Returns the area of a cell; `None` for a cell of another kind.
    pub fn area(&self, cell: &ExploredCell) -> Option<Rect> {
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

// Cells of agents.

/// Default step to which observed values are rounded.
const LOOKOUT_FINENESS: f32 = 0.125;

/// The kind of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CellKind {
    /// The game's own cells.
    Own,
    /// Positions on a grid.
    Positions,
    /// Rounded observations.
    Values,
}

/// Computes the cells of agents.
#[derive(Clone, Copy)]
pub(super) struct Lookout<'a> {
    grid: CellGrid,
    /// The cells that can be passed.
    open: Option<&'a BTreeSet<ExploredCell>>,
    /// The farthest that an agent moves in a tick.
    reach: f32,
    fineness: f32,
    kind: Option<CellKind>,
}

/// A cell, and the tick of the episode in which the agent was there.
pub(super) struct Spotted {
    pub ticks: u32,
    pub cell: ExploredCell,
    /// Position of the agent, if cells are positions.
    pub position: Option<Vec2>,
    /// The open cells that it passed since the position of the tick before.
    pub passed: Vec<ExploredCell>,
}

impl<'a> Lookout<'a> {
    /// Creates it for cells of this grid, unless the game has its own cells, or reports no positions. Of the cells that
    /// are passed between two ticks only open ones count, if they are known. `tile` is the side of a tile.
    pub fn new(grid: CellGrid, cell_size: Option<f32>, open: Option<&'a BTreeSet<ExploredCell>>, tile: f32) -> Self {
        Self { grid, open, reach: reach(tile), fineness: cell_size.unwrap_or(LOOKOUT_FINENESS), kind: None }
    }

    /// Returns whether cells are squares of the grid; false before the first agent was seen.
    pub fn has_positions(&self) -> bool {
        self.kind == Some(CellKind::Positions)
    }

    /// Returns the kind of the cells in words, and the assumption behind it; `None` before the first agent was seen.
    pub fn describe(&self) -> Option<String> {
        let cells = match self.kind? {
            CellKind::Own => "the game's own cells".to_owned(),
            CellKind::Positions => format!("cells of size {}", self.grid.size),
            CellKind::Values => format!("observations in steps of {}", self.fineness),
        };
        Some(format!("{cells}; states within one cell are taken as equal"))
    }

    /// Returns the cell of an agent after this many ticks, with its position a tick before, if that is known. An
    /// observation is older by a tick, since it is made before the action.
    pub fn spot(
        &mut self,
        game: &dyn Game,
        world: &World,
        agent: Entity,
        ticks: u32,
        before: Option<Vec2>,
    ) -> Option<Spotted> {
        let alone = |ticks, cell| Spotted { ticks, cell, position: None, passed: Vec::new() };
        match *self.kind.get_or_insert_with(|| kind_of(game, world, agent)) {
            CellKind::Own => game.tools().state.explore_cell(world, agent).map(|cell| alone(ticks, ExploredCell(cell))),
            CellKind::Positions => {
                let position = game.tools().state.position(world, agent)?;
                let cell = self.grid.cell_at(position)?;
                let passed = before.map_or_else(Vec::new, |before| self.passed(before, position));
                Some(Spotted { ticks, cell, position: Some(position), passed })
            }
            CellKind::Values => {
                let values = &world.get::<Observation>(agent)?.vector;
                let cell = values.iter().map(|value| (value / self.fineness).floor() as i32).collect();
                Some(alone(ticks.checked_sub(1)?, ExploredCell(cell)))
            }
        }
    }

    /// Returns the open cells between two positions.
    fn passed(&self, from: Vec2, to: Vec2) -> Vec<ExploredCell> {
        let Some(open) = self.open else { return Vec::new() };
        let between = cells_between(self.grid, from, to, self.reach).map(|cell| ExploredCell(cell.to_vec()));
        between.filter(|cell| open.contains(cell)).collect()
    }
}

fn kind_of(game: &dyn Game, world: &World, agent: Entity) -> CellKind {
    if game.tools().state.explore_cell(world, agent).is_some() {
        CellKind::Own
    } else if game.tools().state.position(world, agent).is_some() {
        CellKind::Positions
    } else {
        CellKind::Values
    }
}

// Cells that an agent passes between two ticks.

/// Most tiles that an agent moves in a tick. An agent that is farther away was teleported, and has passed nothing.
const FARTHEST: f32 = 4.0;

/// Returns the farthest that an agent moves in a tick, for tiles of this side.
pub(crate) fn reach(tile: f32) -> f32 {
    FARTHEST * tile
}

/// Returns the cells between those of two positions, along a straight line, without the first and the last. The
/// list is empty if the positions are farther apart than `reach`. A line through a corner goes diagonally from cell to
/// cell, and touches no third one.
pub(crate) fn cells_between(grid: CellGrid, from: Vec2, to: Vec2, reach: f32) -> CellsBetween {
    let [from, to] = [from, to].map(|position| ((position - grid.origin) / grid.size).to_array());
    let at = from.map(|value| value.floor() as i32);
    let is_near = Vec2::from_array(from).distance(Vec2::from_array(to)) * grid.size <= reach;
    // NaN is not near either.
    let end = if is_near { to.map(|value| value.floor() as i32) } else { at };
    let crossing = [0_usize, 1].map(|axis| {
        let border = if to[axis] > from[axis] { from[axis].floor() + 1.0 } else { from[axis].floor() };
        (border - from[axis]) / (to[axis] - from[axis])
    });
    let each = [0_usize, 1].map(|axis| 1.0 / (to[axis] - from[axis]).abs());
    CellsBetween { at, end, crossing, each }
}

/// Column and row of each cell on a line.
pub(crate) struct CellsBetween {
    at: [i32; 2],
    end: [i32; 2],
    /// The part of the line up to the next column and the next row.
    crossing: [f32; 2],
    /// The part of the line within a column and within a row.
    each: [f32; 2],
}

impl CellsBetween {
    /// Returns where the next column or row begins; infinity for the last one.
    fn next_border(&self, axis: usize) -> f32 {
        if self.at[axis] == self.end[axis] { f32::INFINITY } else { self.crossing[axis] }
    }

    fn cross(&mut self, axis: usize) {
        self.at[axis] += (self.end[axis] - self.at[axis]).signum();
        self.crossing[axis] += self.each[axis];
    }
}

impl Iterator for CellsBetween {
    type Item = [i32; 2];

    fn next(&mut self) -> Option<[i32; 2]> {
        if self.at == self.end {
            return None;
        }
        let [column, row] = [self.next_border(0), self.next_border(1)];
        if column <= row {
            self.cross(0);
        }
        if row <= column {
            self.cross(1);
        }
        (self.at != self.end).then_some(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_read_back_as_they_are_printed() {
        let cell = ExploredCell(vec![3, -4]);
        assert_eq!(cell.to_string(), "3,-4");
        assert_eq!("3,-4".parse(), Ok(cell));
        for bad in ["", "3,", "a,1", "1.5,2"] {
            let error = bad.parse::<ExploredCell>().expect_err(bad).to_string();
            assert!(error.contains(&format!("`{bad}` is not a cell")) && error.contains("3,4"), "{error}");
        }
    }

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
        assert_eq!(grid.cell_at(Vec2::new(8.0, 4.0)), Some(ExploredCell(vec![2, 1])));
        assert_eq!(grid.cell_at(Vec2::splat(-3.0)), Some(ExploredCell(vec![-1, -1])));
        let area = grid.area(&ExploredCell(vec![2, 1])).expect("a square");
        assert!(area.center().distance(Vec2::new(7.8, 3.8)) < 1e-4, "{area:?}");
    }

    #[test]
    fn another_size_is_taken_and_levels_without_a_plan_have_squares_of_side_1() {
        assert_eq!(CellGrid::new(Some(&plan()), Some(0.5)).size, 0.5);
        let bare = CellGrid::new(None, None);
        assert_eq!((bare.origin, bare.size), (Vec2::ZERO, 1.0));
        assert_eq!(bare.cell_at(Vec2::new(f32::NAN, 0.0)), None);
        assert_eq!(bare.area(&ExploredCell(vec![1, 2, 3])), None);
        let empty = FloorPlan { bounds: Rect::new(0.0, 0.0, 32.0, 8.0), ..FloorPlan::default() };
        assert_eq!(CellGrid::new(Some(&empty), None).size, 2.0);
    }

    const GRID: CellGrid = CellGrid { origin: Vec2::new(-1.0, 0.0), size: 0.5 };

    fn between(from: [f32; 2], to: [f32; 2]) -> Vec<[i32; 2]> {
        // In cells, from the corner of the grid.
        let [from, to] = [from, to].map(|position| GRID.origin + Vec2::from_array(position) * GRID.size);
        cells_between(GRID, from, to, reach(0.5)).collect()
    }

    #[test]
    fn cells_on_the_line_are_passed_and_its_ends_are_not() {
        assert_eq!(between([0.5, 0.5], [3.5, 0.5]), [[1, 0], [2, 0]]);
        assert_eq!(between([0.5, 3.5], [0.5, 0.5]), [[0, 2], [0, 1]]);
        assert_eq!(between([2.75, 0.5], [0.5, 1.25]), [[1, 0], [1, 1]]);
        for near in [[0.5, 0.5], [0.75, 0.25], [1.5, 0.5], [0.5, -0.5]] {
            assert!(between([0.5, 0.5], near).is_empty(), "{near:?}");
        }
    }

    #[test]
    fn corners_are_no_cells() {
        assert_eq!(between([0.5, 0.5], [2.5, 2.5]), [[1, 1]]);
        assert_eq!(between([2.5, 0.5], [0.5, 2.5]), [[1, 1]]);
    }

    #[test]
    fn an_agent_that_is_put_elsewhere_passes_nothing() {
        assert_eq!(between([0.5, 0.5], [4.5, 0.5]).len(), 3, "just as far as one can go");
        for far in [[4.75, 0.5], [90.0, 0.5], [f32::NAN, 0.5], [f32::INFINITY, 0.5]] {
            assert!(between([0.5, 0.5], far).is_empty(), "{far:?}");
        }
    }
}

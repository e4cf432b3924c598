//! Mazes on a grid, without an engine: fixed maps, a generator and a planner, for every game that is played in one.
//!
//! A [`Maze`] is rows of wall and free [`Cell`]s with a start and a reachable goal. The size of a cell and the
//! direction of its axes belong to the game. [`fixed`] has the maps of the literature, [`generate`] makes mazes from a
//! [`MazeSpec`] and a seed, and [`Planner`] finds paths to a goal from everywhere.
//!
//! The folder, in reading order:
//!
//! - `rows`: walls and free cells in rows, and mazes as text.
//! - `map` and [`fixed`]: the map of a mode, and the maps of the literature.
//! - `generator`: size and shape of generated mazes, and mazes from a seed.
//! - [`planner`]: best moves to a goal, distances and proofs.
//! - [`show_level`]: a maze on the command line.
//! - `error`: errors of mazes; `defects`: the defects that games in mazes share.

pub(crate) mod defects;
mod error;
pub mod fixed;
mod generator;
mod map;
pub mod planner;
mod rows;
pub mod show_level;

use crate::maze::{generator::Draw, rows::Walls};
use bevy_playbot::state_hash::StateHash;
use serde::{Deserialize, Serialize};
use std::{fmt, ops::RangeInclusive};

pub(crate) use crate::maze::rows::reward_mismatch;
pub use crate::maze::{
    error::{MAX_CELLS, MAX_SIDE, MazeError},
    generator::{HELD_OUT_SEEDS, MazeModeError, MazeSpec, OptionError, TRAIN_SEEDS, generate, read_mode},
    map::Map,
    planner::{Distances, GridMove, Planner},
    rows::read_maze,
};

/// Walls and free cells in rows, closed all around, with a start and a goal.
///
/// The goal can be reached from the start, except in mazes from files: see [`parse_drawn`](Self::parse_drawn).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Maze {
    walls: Walls,
    start: Cell,
    goal: Cell,
}

impl Maze {
    fn new(walls: Walls, start: Cell, goal: Cell) -> Result<Self, MazeError> {
        Self::drawn(walls, start, goal)?.with_ends(start, goal)
    }

    /// Takes a maze as drawn: its goal may be unreachable.
    fn drawn(walls: Walls, start: Cell, goal: Cell) -> Result<Self, MazeError> {
        let on_border =
            |cell: &Cell| [0, walls.rows - 1].contains(&cell.row) || [0, walls.columns - 1].contains(&cell.col);
        if let Some(gap) = walls.free_cells().find(on_border) {
            return Err(MazeError::Open(gap));
        }
        Self { walls, start, goal }.with_any_ends(start, goal)
    }

    /// Returns the same walls with another start and goal, with or without a path between them.
    ///
    /// # Errors
    ///
    /// One of them is no free cell.
    pub fn with_any_ends(self, start: Cell, goal: Cell) -> Result<Self, MazeError> {
        match [start, goal].into_iter().find(|&cell| !self.is_free(cell)) {
            Some(cell) => Err(MazeError::NotFree(cell)),
            None => Ok(Self { start, goal, ..self }),
        }
    }

    /// Returns the same walls with another start and goal.
    ///
    /// # Errors
    ///
    /// One of them is no free cell, or there is no path between them.
    pub fn with_ends(self, start: Cell, goal: Cell) -> Result<Self, MazeError> {
        let maze = self.with_any_ends(start, goal)?;
        maze.distances_to(goal).get(start).ok_or(MazeError::Unreachable { start, goal })?;
        Ok(maze)
    }

    /// Returns the start cell, unless the game draws another one.
    pub fn start(&self) -> Cell {
        self.start
    }

    /// Returns the goal cell.
    pub fn goal(&self) -> Cell {
        self.goal
    }

    /// Returns the number of rows, the border included.
    pub fn rows(&self) -> usize {
        self.walls.rows
    }

    /// Returns the number of columns, the border included.
    pub fn columns(&self) -> usize {
        self.walls.columns
    }

    /// Returns a hash of the walls, whatever start and goal are.
    pub fn fingerprint(&self) -> u64 {
        let size = [self.walls.rows as u64, self.walls.columns as u64];
        StateHash::of(size.into_iter().chain(self.walls.cells().map(|cell| self.is_free(cell).into()))).0
    }

    /// Returns true if a cell is no wall; false outside the maze.
    pub fn is_free(&self, cell: Cell) -> bool {
        self.walls.is_free(cell)
    }

    /// Returns every cell that is no wall, start and goal included, row by row.
    pub fn free_cells(&self) -> impl Iterator<Item = Cell> + '_ {
        self.walls.free_cells()
    }

    /// Returns every cell that is a wall, row by row.
    pub fn wall_cells(&self) -> impl Iterator<Item = Cell> + '_ {
        self.walls.cells().filter(|&cell| !self.is_free(cell))
    }

    /// Returns the free cells that share a side with this one: above, below, left, right.
    pub fn neighbours(&self, cell: Cell) -> impl Iterator<Item = Cell> + '_ {
        self.walls.neighbours(cell)
    }

    /// Returns the number of moves between side by side cells that each free cell is away from `cell`: breadth first.
    pub fn distances_to(&self, cell: Cell) -> Distances {
        Distances::to(&self.walls, cell)
    }

    /// Returns a shortest path from the start to the goal, both included; empty if there is none.
    pub fn shortest_path(&self) -> Vec<Cell> {
        self.shortest_path_between(self.start, self.goal).unwrap_or_default()
    }

    /// Returns a shortest path between two free cells, both included; `None` if there is none. Where several are
    /// equally short, it goes up rather than down, down rather than left, and left rather than right.
    pub fn shortest_path_between(&self, from: Cell, to: Cell) -> Option<Vec<Cell>> {
        let away = self.distances_to(to);
        let mut left = away.get(from)?;
        let mut path = vec![from];
        let mut at = from;
        while left > 0 {
            left -= 1;
            at = self.neighbours(at).find(|&cell| away.get(cell) == Some(left))?;
            path.push(at);
        }
        Some(path)
    }

    /// Returns the number of moves on a shortest path from the start to the goal; 0 if there is none.
    pub fn difficulty(&self) -> usize {
        self.shortest_path().len().saturating_sub(1)
    }
}

/// A cell of a maze, counted from 0 at the first character of the first row. Written `(row, column)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(from = "[usize; 2]", into = "[usize; 2]")]
pub struct Cell {
    /// Row, from the top of the text.
    pub row: usize,
    /// Column, from the left of the text.
    pub col: usize,
}

impl Cell {
    /// Returns the cell in this row and column.
    pub const fn new(row: usize, col: usize) -> Self {
        Self { row, col }
    }

    /// Returns the cell that many rows and columns further on; `None` before the first row or column.
    pub fn moved(self, rows: i32, columns: i32) -> Option<Self> {
        let along = |index: usize, by: i32| index.checked_add_signed(by as isize);
        Some(Self { row: along(self.row, rows)?, col: along(self.col, columns)? })
    }
}

impl From<[usize; 2]> for Cell {
    fn from([row, col]: [usize; 2]) -> Self {
        Self { row, col }
    }
}

impl From<Cell> for [usize; 2] {
    fn from(cell: Cell) -> Self {
        [cell.row, cell.col]
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}, {})", self.row, self.col)
    }
}

/// Starts that are tried for a wanted difficulty.
const STARTS: usize = 32;

/// Draws start and goal: as far apart as possible, or with a shortest path of so many moves.
///
/// Otherwise the moves of the longest shortest path that was found.
fn choose_ends(walls: &Walls, wanted: Option<&RangeInclusive<usize>>, draw: &mut Draw) -> Result<(Cell, Cell), usize> {
    let free: Vec<_> = walls.free_cells().collect();
    let first = draw.pick(&free).ok_or(0usize)?;
    let (one, other, longest) = far_apart(walls, first);
    let Some(wanted) = wanted else {
        let flip = draw.below(2) == 1;
        return Ok(if flip { (other, one) } else { (one, other) });
    };
    if *wanted.start() > longest {
        return Err(longest);
    }
    // From one end of the longest path every shorter distance occurs: the last start to try always works.
    let starts = (0..STARTS).map(|_| free[draw.below(free.len())]).chain([one]).collect::<Vec<_>>();
    for start in starts {
        let away = Distances::to(walls, start);
        let fits = |cell: &Cell| *cell != start && away.get(*cell).is_some_and(|moves| wanted.contains(&moves));
        let goals: Vec<_> = free.iter().copied().filter(fits).collect();
        if let Some(goal) = draw.pick(&goals) {
            return Ok((start, goal));
        }
    }
    Err(longest)
}

/// Returns two cells far apart and the moves between them. Walks to the farthest cell, turns around, and goes on as
/// long as that makes the path longer. Without loops no two cells are farther apart; with loops no cell is farther from
/// either.
fn far_apart(walls: &Walls, from: Cell) -> (Cell, Cell, usize) {
    let (mut one, _) = Distances::to(walls, from).farthest();
    let (mut other, mut longest) = Distances::to(walls, one).farthest();
    loop {
        let (next, moves) = Distances::to(walls, other).farthest();
        if moves <= longest {
            return (one, other, longest);
        }
        (one, other, longest) = (other, next, moves);
    }
}

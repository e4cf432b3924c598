//! A maze: walls, a start and a goal.

use bevy_playbot::state_hash::StateHash;

use super::{cell::Cell, distances::Distances, error::MazeError, walls::Walls};

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
    pub(super) fn new(walls: Walls, start: Cell, goal: Cell) -> Result<Self, MazeError> {
        Self::drawn(walls, start, goal)?.with_ends(start, goal)
    }

    /// Takes a maze as drawn: its goal may be unreachable.
    pub(super) fn drawn(walls: Walls, start: Cell, goal: Cell) -> Result<Self, MazeError> {
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

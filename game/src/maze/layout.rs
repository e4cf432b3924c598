//! A maze: walls, a start and a goal.

use bevy_playbot::state_hash::StateHash;

use super::{cell::Cell, distances::Distances, error::MazeError};

/// Most cells to a side.
pub const MAX_SIDE: usize = 4096;
/// Most cells in all.
pub const MAX_CELLS: usize = 1 << 22;

/// Walls and free cells in rows, closed all around, with a goal that can be reached from the start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Maze {
    walls: Walls,
    start: Cell,
    goal: Cell,
}

/// The walls alone, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Walls {
    pub(super) rows: usize,
    pub(super) columns: usize,
    free: Vec<bool>,
}

impl Walls {
    /// Nothing but walls.
    pub(super) fn solid(rows: usize, columns: usize) -> Result<Self, MazeError> {
        check_size(rows, columns)?;
        Ok(Self { rows, columns, free: vec![false; rows * columns] })
    }

    /// The place of a cell in row-major lists.
    pub(super) fn index(&self, cell: Cell) -> usize {
        cell.row * self.columns + cell.col
    }

    pub(super) fn is_free(&self, cell: Cell) -> bool {
        cell.row < self.rows && cell.col < self.columns && self.free[self.index(cell)]
    }

    pub(super) fn open(&mut self, cell: Cell) {
        let index = self.index(cell);
        self.free[index] = true;
    }

    pub(super) fn cells(&self) -> impl Iterator<Item = Cell> + use<> {
        let (rows, columns) = (self.rows, self.columns);
        (0..rows).flat_map(move |row| (0..columns).map(move |col| Cell { row, col }))
    }

    pub(super) fn free_cells(&self) -> impl Iterator<Item = Cell> + '_ {
        self.cells().filter(|&cell| self.is_free(cell))
    }

    pub(super) fn neighbours(&self, cell: Cell) -> impl Iterator<Item = Cell> + '_ {
        let Cell { row, col } = cell;
        let up = row.checked_sub(1).map(|row| Cell { row, col });
        let left = col.checked_sub(1).map(|col| Cell { row, col });
        let around = [up, Some(Cell { row: row + 1, col }), left, Some(Cell { row, col: col + 1 })];
        around.into_iter().flatten().filter(|&cell| self.is_free(cell))
    }
}

/// Refuses sizes that are nothing or too much.
pub(super) fn check_size(rows: usize, columns: usize) -> Result<(), MazeError> {
    if rows == 0 || columns == 0 {
        return Err(MazeError::Empty);
    }
    let fits = rows <= MAX_SIDE && columns <= MAX_SIDE && rows * columns <= MAX_CELLS;
    if fits { Ok(()) } else { Err(MazeError::TooLarge { rows, columns }) }
}

impl Maze {
    pub(super) fn new(walls: Walls, start: Cell, goal: Cell) -> Result<Self, MazeError> {
        let on_border =
            |cell: &Cell| [0, walls.rows - 1].contains(&cell.row) || [0, walls.columns - 1].contains(&cell.col);
        if let Some(gap) = walls.free_cells().find(on_border) {
            return Err(MazeError::Open(gap));
        }
        Self { walls, start, goal }.with_ends(start, goal)
    }

    /// The same walls with another start and goal.
    ///
    /// # Errors
    ///
    /// One of them is no free cell, or there is no way between them.
    pub fn with_ends(self, start: Cell, goal: Cell) -> Result<Self, MazeError> {
        if let Some(cell) = [start, goal].into_iter().find(|&cell| !self.is_free(cell)) {
            return Err(MazeError::NotFree(cell));
        }
        let maze = Self { start, goal, ..self };
        maze.distances_to(goal).get(start).ok_or(MazeError::Unreachable { start, goal })?;
        Ok(maze)
    }

    /// Where the player starts, unless the game draws another cell.
    pub fn start(&self) -> Cell {
        self.start
    }

    /// Where the player should go.
    pub fn goal(&self) -> Cell {
        self.goal
    }

    /// Number of rows, the border included.
    pub fn rows(&self) -> usize {
        self.walls.rows
    }

    /// Number of columns, the border included.
    pub fn columns(&self) -> usize {
        self.walls.columns
    }

    /// A hash of the walls, whatever start and goal are.
    pub fn fingerprint(&self) -> u64 {
        let size = [self.walls.rows as u64, self.walls.columns as u64];
        StateHash::of(size.into_iter().chain(self.walls.free.iter().map(|&free| free.into()))).0
    }

    /// Whether a cell is no wall; false outside the maze.
    pub fn is_free(&self, cell: Cell) -> bool {
        self.walls.is_free(cell)
    }

    /// Every cell that is no wall, start and goal included, row by row.
    pub fn free_cells(&self) -> impl Iterator<Item = Cell> + '_ {
        self.walls.free_cells()
    }

    /// Every cell that is a wall, row by row.
    pub fn wall_cells(&self) -> impl Iterator<Item = Cell> + '_ {
        self.walls.cells().filter(|&cell| !self.is_free(cell))
    }

    /// The free cells that share a side with this one: above, below, left, right.
    pub fn neighbours(&self, cell: Cell) -> impl Iterator<Item = Cell> + '_ {
        self.walls.neighbours(cell)
    }

    /// The number of moves between side by side cells that each free cell is away from `cell`: breadth first.
    pub fn distances_to(&self, cell: Cell) -> Distances {
        Distances::to(&self.walls, cell)
    }

    /// A shortest path from the start to the goal, both included.
    pub fn shortest_path(&self) -> Vec<Cell> {
        self.shortest_path_between(self.start, self.goal).expect("checked when the maze was made")
    }

    /// A shortest path between two free cells, both included; `None` if there is none. Where several are equally short,
    /// it goes up rather than down, down rather than left, and left rather than right.
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

    /// Number of moves on a shortest path from the start to the goal.
    pub fn difficulty(&self) -> usize {
        self.shortest_path().len() - 1
    }
}

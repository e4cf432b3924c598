//! Walls and free cells in rows.

use crate::maze::{
    Cell,
    error::{MAX_CELLS, MAX_SIDE, MazeError},
};

/// The walls alone, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Walls {
    pub(super) rows: usize,
    pub(super) columns: usize,
    free: Vec<bool>,
}

impl Walls {
    /// Returns walls only.
    pub(super) fn solid(rows: usize, columns: usize) -> Result<Self, MazeError> {
        check_size(rows, columns)?;
        Ok(Self { rows, columns, free: vec![false; rows * columns] })
    }

    /// Returns the index of a cell in row-major lists.
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

/// Refuses sizes of zero, and sizes that are too large.
pub(super) fn check_size(rows: usize, columns: usize) -> Result<(), MazeError> {
    if rows == 0 || columns == 0 {
        return Err(MazeError::Empty);
    }
    let fits = rows <= MAX_SIDE && columns <= MAX_SIDE && rows * columns <= MAX_CELLS;
    if fits { Ok(()) } else { Err(MazeError::TooLarge { rows, columns }) }
}

/// Describes a reward that differs from the rules by more than `slack`; `None` if it does not.
pub(crate) fn reward_mismatch(paid: f32, by_rules: f32, slack: f32) -> Option<String> {
    // NaN is not near to anything.
    let is_same = (paid - by_rules).abs() <= slack;
    (!is_same).then(|| format!("the tick paid {paid}; by the rules it pays {by_rules}"))
}

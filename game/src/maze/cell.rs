//! Cells of a maze.

use std::fmt;

use serde::{Deserialize, Serialize};

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

//! Errors of mazes.

use crate::maze::Cell;
use thiserror::Error;

/// The maze cannot be played or made. Rows and columns are counted from 0.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum MazeError {
    /// There are no cells.
    #[error("the maze is empty: write its rows, one below the other, with # for a wall and O for a free cell")]
    Empty,
    /// It would not fit into memory.
    #[error(
        "a maze of {rows} x {columns} cells is too large: at most {MAX_SIDE} cells to the side and {MAX_CELLS} in all"
    )]
    TooLarge {
        /// Requested rows.
        rows: usize,
        /// Requested columns.
        columns: usize,
    },
    /// The rows differ in length.
    #[error("row {row} has {columns} cells and row 0 has {expected}: give all rows the same length")]
    Ragged {
        /// First row that differs.
        row: usize,
        /// Its length.
        columns: usize,
        /// Length of the first row.
        expected: usize,
    },
    /// An unknown character.
    #[error(
        "row {row}, column {column}: `{character}` means nothing; write # or 1 for a wall, O, 0, a blank or a point for a free cell, S or r for the start, G or g for the goal"
    )]
    UnknownCharacter {
        /// Row of the character.
        row: usize,
        /// Column of the character.
        column: usize,
        /// The character.
        character: char,
    },
    /// No start.
    #[error("the maze has no start: mark a free cell with S or r")]
    NoStart,
    /// No goal.
    #[error("the maze has no goal: mark a free cell with G or g")]
    NoGoal,
    /// Two starts or two goals.
    #[error("the maze has two {what}s, {first} and {second}: leave one of them")]
    Twice {
        /// `start` or `goal`.
        what: &'static str,
        /// The one that was read first.
        first: Cell,
        /// The other.
        second: Cell,
    },
    /// The border has a gap.
    #[error("the border is open at {0}: close it with walls")]
    Open(Cell),
    /// A start or goal inside a wall or outside the maze.
    #[error("{0} is not a free cell of the maze")]
    NotFree(Cell),
    /// There is no path to the goal.
    #[error("the goal {goal} cannot be reached from the start {start}: open a path between them")]
    Unreachable {
        /// The start.
        start: Cell,
        /// The goal.
        goal: Cell,
    },
    /// Too small to hold two free cells.
    #[error("`size={rows}x{columns}` has no room for corridors {corridor} wide: each side needs {least} cells or more")]
    TooSmall {
        /// Requested rows.
        rows: usize,
        /// Requested columns.
        columns: usize,
        /// Width of the corridors, cells.
        corridor: usize,
        /// Smallest side that works.
        least: usize,
    },
    /// Corridors without width.
    #[error("corridors are at least 1 cell wide")]
    NoCorridor,
    /// The share of removed walls is outside 0 to 1.
    #[error("loops = {0}: it is a share of the walls and lies between 0 and 1")]
    Loops(String),
    /// The range of moves is empty.
    #[error(
        "difficulty = {least}..{most}: write the fewest and the most moves of a shortest path, the most at least 1"
    )]
    NoDifficulty {
        /// Fewest requested moves.
        least: usize,
        /// Most requested moves.
        most: usize,
    },
    /// No pair of cells is so far apart.
    #[error(
        "no shortest path has {least} to {most} moves: the longest of this maze has {longest}; ask for less or for a \
         larger maze"
    )]
    Difficulty {
        /// Fewest requested moves.
        least: usize,
        /// Most requested moves.
        most: usize,
        /// Moves of the longest shortest path.
        longest: usize,
    },
}

/// Most cells to a side.
pub const MAX_SIDE: usize = 4096;

/// Most cells in all.
pub const MAX_CELLS: usize = 1 << 22;

//! Shared parts of the level files of maze games.

use playbot_lab::level_files::{
    JsonStep::{Index, Key},
    LevelTextError,
};

use super::{cell::Cell, error::MazeError, layout::Maze};

/// Reads the maze of a level file: rows, the first one at the top, with start and goal as letters in them, as cells, or
/// both.
///
/// # Errors
///
/// The mistake, with its line.
pub fn read_maze(text: &str, rows: &[String], start: Option<Cell>, goal: Option<Cell>) -> Result<Maze, LevelTextError> {
    Maze::parse_drawn(rows, start, goal).map_err(|error| at_maze(text, &error))
}

/// Returns a mistake in a maze, on the line where it is.
fn at_maze(text: &str, error: &MazeError) -> LevelTextError {
    let row = match *error {
        MazeError::Ragged { row, .. } | MazeError::UnknownCharacter { row, .. } => Some(row),
        MazeError::Twice { second: cell, .. } | MazeError::Open(cell) | MazeError::NotFree(cell) => Some(cell.row),
        _ => None,
    };
    let what = error.to_string();
    match row {
        Some(row) => LevelTextError::at(text, &[Key("rows"), Index(row)], what),
        None => LevelTextError::at(text, &[Key("rows")], what),
    }
}

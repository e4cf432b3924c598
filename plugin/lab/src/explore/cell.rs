//! The cells of an exploration: groups of states that count as the same.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A group of states that count as the same: a square of a grid, the game's own cell, or similar observations.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Cell(pub Vec<i32>);

/// The text is not a cell.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("`{0}` is not a cell: write its numbers as they are printed, separated by commas, such as 3,4")]
pub struct NoCell(pub String);

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<_> = self.0.iter().map(ToString::to_string).collect();
        f.write_str(&words.join(","))
    }
}

impl FromStr for Cell {
    type Err = NoCell;

    fn from_str(text: &str) -> Result<Self, NoCell> {
        let numbers: Result<Vec<i32>, _> = text.split(',').map(|word| word.trim().parse()).collect();
        numbers.map(Self).map_err(|_| NoCell(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_read_back_as_they_are_printed() {
        let cell = Cell(vec![3, -4]);
        assert_eq!(cell.to_string(), "3,-4");
        assert_eq!("3,-4".parse(), Ok(cell));
        for bad in ["", "3,", "a,1", "1.5,2"] {
            let error = bad.parse::<Cell>().expect_err(bad).to_string();
            assert!(error.contains(&format!("`{bad}` is not a cell")) && error.contains("3,4"), "{error}");
        }
    }
}

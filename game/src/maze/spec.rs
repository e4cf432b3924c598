//! Size and shape of generated mazes.

use crate::maze::{error::MazeError, walls::check_size};
use bevy_playbot::unknown_name::UnknownName;
use playbot_harness::mode::ModeError;
use std::{ops::RangeInclusive, str::FromStr};
use thiserror::Error;

/// Default seeds of the mazes to learn from.
pub const TRAIN_SEEDS: RangeInclusive<u64> = 0..=63;

/// Default seeds of the held-out mazes of the test.
pub const HELD_OUT_SEEDS: RangeInclusive<u64> = 64..=127;

/// Size and shape of generated mazes.
///
/// Corridors join rooms of `corridor` x `corridor` cells that stand in a grid, one wall apart. Cells that a row of
/// rooms does not fill thicken the wall at the far side.
#[derive(Clone, Debug, PartialEq)]
pub struct MazeSpec {
    /// Rows of cells, the border included.
    pub rows: usize,
    /// Columns of cells, the border included.
    pub columns: usize,
    /// Share of the walls between neighbouring rooms that is removed once every room can be reached in exactly one way,
    /// 0 to 1. At 0 there is one path between any two rooms, at 1 no wall is left between them.
    pub loops: f64,
    /// Width of the corridors, cells; at least 1.
    pub corridor: usize,
    /// Range of moves of the shortest path from start to goal. `None` puts start and goal as far apart as possible.
    pub difficulty: Option<RangeInclusive<usize>>,
}

impl Default for MazeSpec {
    fn default() -> Self {
        Self { rows: 11, columns: 11, loops: 0.1, corridor: 1, difficulty: None }
    }
}

impl MazeSpec {
    /// Checks everything that does not need a maze.
    ///
    /// # Errors
    ///
    /// [`MazeError`] names the impossible value.
    pub fn check(&self) -> Result<(), MazeError> {
        let Self { rows, columns, loops, corridor, .. } = *self;
        if corridor == 0 {
            return Err(MazeError::NoCorridor);
        }
        let least = corridor.saturating_mul(2).saturating_add(3);
        if rows < least || columns < least {
            return Err(MazeError::TooSmall { rows, columns, corridor, least });
        }
        check_size(rows, columns)?;
        if !(0.0..=1.0).contains(&loops) {
            return Err(MazeError::Loops(loops.to_string()));
        }
        match &self.difficulty {
            Some(wanted) if wanted.is_empty() || *wanted.end() == 0 => {
                Err(MazeError::NoDifficulty { least: *wanted.start(), most: *wanted.end() })
            }
            _ => Ok(()),
        }
    }
}

// Generated mazes as options of a mode: `size=9x9+loops=0.2`.

/// The value of an option cannot be read.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("`{key}={value}`: {wanted}")]
pub struct OptionError {
    /// The option.
    pub key: String,
    /// The given value.
    pub value: String,
    /// The expected form.
    pub wanted: &'static str,
}

impl OptionError {
    /// Takes an option with the expected form.
    pub fn new(key: &str, value: &str, wanted: &'static str) -> Self {
        Self { key: key.to_owned(), value: value.to_owned(), wanted }
    }
}

impl MazeSpec {
    /// Options of a mode with generated mazes, each with a value it takes.
    pub const OPTIONS: [&'static str; 4] = ["size=9x9", "loops=0.2", "corridor=2", "difficulty=10..20"];

    /// Takes one option; false if it is none of a maze's.
    ///
    /// # Errors
    ///
    /// The value cannot be read. Its meaning is [`check`](Self::check)ed apart.
    pub fn set_option(&mut self, key: &str, value: &str) -> Result<bool, OptionError> {
        let wrong = |wanted| OptionError::new(key, value, wanted);
        match key {
            "size" => {
                (self.rows, self.columns) =
                    pair(value, "x").ok_or_else(|| wrong("write rows x columns, as in size=9x9"))?
            }
            "loops" => {
                self.loops = value.parse().map_err(|_| wrong("write a share between 0 and 1, as in loops=0.2"))?
            }
            "corridor" => self.corridor = value.parse().map_err(|_| wrong("write cells, as in corridor=2"))?,
            "difficulty" => {
                let read =
                    range(value).ok_or_else(|| wrong("write moves, as in difficulty=12 or difficulty=10..20"))?;
                self.difficulty = Some(read);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Returns the options that differ from the default, as [`set_option`](Self::set_option) takes them: `key=value`.
    pub fn options(&self) -> Vec<String> {
        let default = Self::default();
        let mut options = Vec::new();
        if (self.rows, self.columns) != (default.rows, default.columns) {
            options.push(format!("size={}x{}", self.rows, self.columns));
        }
        if self.loops != default.loops {
            options.push(format!("loops={}", self.loops));
        }
        if self.corridor != default.corridor {
            options.push(format!("corridor={}", self.corridor));
        }
        if let Some(wanted) = &self.difficulty {
            options.push(format!("difficulty={}..{}", wanted.start(), wanted.end()));
        }
        options
    }
}

fn pair<T: FromStr>(text: &str, between: &str) -> Option<(T, T)> {
    let (left, right) = text.split_once(between)?;
    Some((left.parse().ok()?, right.parse().ok()?))
}

/// Parses `10..20`, both ends included, or one number.
fn range(text: &str) -> Option<RangeInclusive<usize>> {
    if let Ok(one) = text.parse() {
        return Some(one..=one);
    }
    pair(text, "..").map(|(least, most)| least..=most)
}

// Errors of maps, and of the modes of maze games.

/// The text is no map, or no mode: a map with options, joined by `+`.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum MazeModeError {
    /// An unknown map or option.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// The value of an option is impossible.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Such a maze is impossible.
    #[error(transparent)]
    Maze(#[from] MazeError),
    /// An option is given twice, or with its opposite.
    #[error("`{0}` repeats or contradicts another option of the mode: leave one of them")]
    Twice(String),
    /// Two options that exclude each other, with advice.
    #[error("{0}")]
    Together(&'static str),
}

impl MazeModeError {
    /// Checks that no two options are about the same `subject`.
    ///
    /// # Errors
    ///
    /// [`Twice`](Self::Twice) with the later one.
    pub(crate) fn check_once<'a>(options: &[&'a str], subject: impl Fn(&'a str) -> &'a str) -> Result<(), Self> {
        let repeats = |&(index, &option): &(usize, &&'a str)| {
            options[..index].iter().any(|&earlier| subject(earlier) == subject(option))
        };
        match options.iter().enumerate().find(repeats) {
            Some((_, &option)) => Err(Self::Twice(option.to_owned())),
            None => Ok(()),
        }
    }
}

/// Parses a mode of a game, with the error type of games.
///
/// # Errors
///
/// The text is no mode.
pub fn read_mode<Mode: FromStr<Err = MazeModeError>>(text: &str) -> Result<Mode, ModeError> {
    text.parse::<Mode>().map_err(|error| match error {
        MazeModeError::Name(unknown) => unknown.into(),
        other => ModeError::Option { mode: text.to_owned(), why: other.to_string() },
    })
}

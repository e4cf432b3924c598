//! Errors of maps, and of the modes of maze games.

use std::str::FromStr;

use bevy_playbot::unknown_name::UnknownName;
use playbot_lab::mode::ModeError;
use thiserror::Error;

use super::{error::MazeError, spec_text::OptionError};

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

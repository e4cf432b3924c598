//! Modes of a game by name, with options behind it where the game takes some.

use thiserror::Error;

use bevy_playbot::unknown_name::UnknownName;

use crate::level_files::LevelFileError;

/// The text names no mode of the game.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum ModeError {
    /// The name, or the name of an option, is none of those that exist.
    #[error(transparent)]
    Unknown(#[from] UnknownName),
    /// The levels are files that cannot be read, or that are no levels of the game.
    #[error(transparent)]
    Files(#[from] LevelFileError),
    /// The mode has levels, but not this one.
    #[error("level {level} of `{mode}` does not exist: choose one up to {last}")]
    NoLevel {
        /// The mode.
        mode: String,
        /// The number that was named.
        level: u64,
        /// The largest number.
        last: u64,
    },
    /// An option has a value that cannot be.
    #[error("mode `{mode}`: {why}")]
    Option {
        /// The whole mode.
        mode: String,
        /// Which option, what is wrong with it and what would be right.
        why: String,
    },
}

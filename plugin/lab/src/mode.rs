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
    /// An option has a value that cannot be.
    #[error("mode `{mode}`: {why}")]
    Option {
        /// The whole mode.
        mode: String,
        /// Which option, what is wrong with it and what would be right.
        why: String,
    },
}

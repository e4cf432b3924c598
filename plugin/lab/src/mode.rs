//! Modes of a game by name, with options behind it where the game takes some.

use thiserror::Error;

use bevy_playbot::unknown_name::UnknownName;

/// The text names no mode of the game.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum ModeError {
    /// The name, or the name of an option, is none of those that exist.
    #[error(transparent)]
    Unknown(#[from] UnknownName),
    /// An option has a value that cannot be.
    #[error("mode `{mode}`: {why}")]
    Option {
        /// The whole mode.
        mode: String,
        /// Which option, what is wrong with it and what would be right.
        why: String,
    },
}

//! Errors of a game's modes, their options and their levels.

use crate::level_files::LevelFileError;
use bevy_playbot::unknown_name::UnknownName;
use playbot_learner::HasExitCode;
use thiserror::Error;

/// Text that is not a mode of the game.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum ModeError {
    /// Unknown name of a mode or option.
    #[error(transparent)]
    Unknown(#[from] UnknownName),
    /// Level files that cannot be read, or that are not levels of the game.
    #[error(transparent)]
    Files(#[from] LevelFileError),
    /// The mode has no level of this number.
    #[error("level {level} of `{mode}` does not exist: `{game}` has {}", levels_to(*.last))]
    NoLevel {
        /// Name of the game.
        game: String,
        /// The mode.
        mode: String,
        /// The requested number.
        level: u64,
        /// Largest number of a level.
        last: u64,
    },
    /// Invalid value of an option.
    #[error("mode `{mode}`: {why}")]
    Option {
        /// The mode, options included.
        mode: String,
        /// The option, its error and the valid values.
        why: String,
    },
}

impl HasExitCode for ModeError {}

fn levels_to(last: u64) -> String {
    if last == 0 { "only one, level 0".to_owned() } else { format!("levels 0 to {last}") }
}

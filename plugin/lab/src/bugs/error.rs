//! What can go wrong with planted defects.

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

use crate::{eval::EvalError, inspect::InspectError, level_files::LevelFileError, mode::ModeError};

/// Defects cannot be planted, or a set of them cannot be used.
#[derive(Debug, Error)]
pub enum BugError {
    /// There is a set already.
    #[error("{} has planted defects already: choose another --out, or replace them with --force", .0.display())]
    Exists(PathBuf),
    /// There is no set.
    #[error("{} has no mutants.json: make one with `playbot bugs make --out {}`", .0.display(), .0.display())]
    Missing(PathBuf),
    /// A file is not what it should be.
    #[error("{}, line {line}: {what}; make the set again with `playbot bugs make`", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// The set was made for another version of the game.
    #[error(
        "{}: the defects of `{game}` were planted into its version {made}, and this program has version {is}: make the set \
         again with `playbot bugs make`", path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// The game.
        game: String,
        /// The version in the set.
        made: u32,
        /// The program's.
        is: u32,
    },
    /// A game has no level into which anything could be planted.
    #[error(
        "`{game}`: none of the levels {levels} is one that nobody trains on and that its bot `{bot}` plays to a good end, \
         so that nothing can be planted into them: name others with --levels {game}=MODE:first..last"
    )]
    NoBase {
        /// The game.
        game: String,
        /// The levels.
        levels: String,
        /// Its demonstrator.
        bot: String,
    },
    /// There are fewer levels than are asked for.
    #[error(
        "`{game}`: {levels} has {count} sound levels, and {wanted} are needed: name more with --levels {game}=MODE:first..last, or \
         ask for fewer with --sound and --per-kind"
    )]
    TooFewLevels {
        /// The game.
        game: String,
        /// The levels.
        levels: String,
        /// How many of them are sound.
        count: u64,
        /// How many are needed.
        wanted: u64,
    },
    /// A kind of defect makes levels that are none.
    #[error("the defect `{class}` of `{game}` makes of {base} what is no level of the game: {why}")]
    NoLevel {
        /// The game.
        game: String,
        /// The class of the defect.
        class: String,
        /// The level, as `MODE:N`.
        base: String,
        /// What is wrong.
        why: String,
    },
    /// A file of the system's.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// On which file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// The game does not have the levels.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// The sound levels cannot be played.
    #[error(transparent)]
    Eval(#[from] EvalError),
    /// A level cannot be shown.
    #[error(transparent)]
    Inspect(#[from] InspectError),
    /// A level file cannot be read.
    #[error(transparent)]
    Level(#[from] LevelFileError),
}

impl BugError {
    /// Whether calling differently helps; otherwise the game or the system failed.
    pub fn is_usage(&self) -> bool {
        !matches!(self, Self::Io { .. } | Self::NoLevel { .. } | Self::Eval(EvalError::Fault(_)))
    }
}

pub(super) fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> BugError {
    move |source| BugError::Io { action, path: path.into(), source }
}

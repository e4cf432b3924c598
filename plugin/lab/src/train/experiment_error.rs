//! What can be wrong with an experiment.

use playbot_learner::LearnError;
use thiserror::Error;

use crate::{mode::ModeError, split::LevelSplit};

/// The experiment makes no sense.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum ExperimentError {
    /// Training and held-out levels share a level.
    #[error("training levels {train} and held-out levels {test} overlap: choose ranges that share no level")]
    Overlap {
        /// Training levels.
        train: LevelSplit,
        /// Held-out levels.
        test: LevelSplit,
    },
    /// A training level shows what a held-out level shows.
    #[error(
        "level {level} of the training levels {train} is, or looks like, one of the held-out levels {test}: choose others"
    )]
    Leak {
        /// Training levels.
        train: Box<LevelSplit>,
        /// The first of them that gives something away.
        level: u64,
        /// Held-out levels.
        test: Box<LevelSplit>,
    },
    /// The game has no such mode.
    #[error("`{key}` is {levels}: {source}; name levels of this game, as in `--set {key}={example}:0..63`")]
    Mode {
        /// Key in the file.
        key: &'static str,
        /// Its value.
        levels: Box<LevelSplit>,
        /// What is wrong with the mode.
        source: Box<ModeError>,
        /// A mode that the game has.
        example: &'static str,
    },
    /// What a training keeps is more than the machine has room for.
    #[error("{what} need {:.1} GiB, and {:.1} GiB of memory are free: lower {keys}", gib(.needed), gib(.free))]
    Memory {
        /// What it is, with the factors.
        what: String,
        /// Bytes that it takes.
        needed: u64,
        /// Bytes that are free.
        free: u64,
        /// What to lower.
        keys: String,
    },
    /// A number is out of range.
    #[error("`{key}` is {value}: {why}")]
    Value {
        /// Key in the file.
        key: &'static str,
        /// Its value.
        value: String,
        /// What it must be.
        why: String,
    },
    /// There is nothing to learn from.
    #[error("`demos` is missing: there is something to learn from recordings, so name a file or a folder of them")]
    NoDemos,
    /// The learner refuses its settings.
    #[error("{0}")]
    Settings(String),
}

fn gib(bytes: &u64) -> f64 {
    *bytes as f64 / f64::from(1 << 30)
}

/// What a learner has against its settings; that they are settings goes without saying.
pub(super) fn settings(error: LearnError) -> ExperimentError {
    ExperimentError::Settings(match error {
        LearnError::Config(text) => text,
        other => other.to_string(),
    })
}

pub(super) fn refuse(key: &'static str, value: impl ToString, why: impl Into<String>) -> Result<(), ExperimentError> {
    Err(ExperimentError::Value { key, value: value.to_string(), why: why.into() })
}

//! Errors of an experiment.

use playbot_learner::{HasExitCode, LearnError, SettingError};
use thiserror::Error;

use crate::{machine::MemoryError, mode::ModeError, split::LevelSplit};

/// An invalid experiment.
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
    /// A training level is equal to a held-out level in content.
    #[error(
        "level {level} of the training levels {train} is, or looks like, one of the held-out levels {test}: choose others"
    )]
    Leak {
        /// Training levels.
        train: Box<LevelSplit>,
        /// The first such level.
        level: u64,
        /// Held-out levels.
        test: Box<LevelSplit>,
    },
    /// The game lacks this mode.
    #[error("`{key}` is {levels}: {source}; name levels of this game, as in `--set {key}={example}:0..63`")]
    Mode {
        /// Key in the file.
        key: &'static str,
        /// Its value.
        levels: Box<LevelSplit>,
        /// The error of the mode.
        source: Box<ModeError>,
        /// A mode that the game has.
        example: &'static str,
    },
    /// Training needs more memory than the machine has.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// A number is out of range.
    #[error("`{key}` is {value}: {why}")]
    Value {
        /// Key in the file.
        key: &'static str,
        /// Its value.
        value: String,
        /// The condition on the value.
        why: String,
    },
    /// No recordings to learn from.
    #[error("`demos` is missing, and this experiment learns from recordings: name a file or a folder of recordings")]
    NoDemos,
    /// The learner refuses its settings.
    #[error("{words}")]
    Settings {
        /// Key or section in the file, if known.
        key: Option<String>,
        /// The error.
        words: String,
    },
}

impl HasExitCode for ExperimentError {}

impl ExperimentError {
    /// Returns the keys or sections to look at, the first one first.
    pub fn keys(&self) -> Vec<&str> {
        match self {
            Self::Overlap { .. } | Self::Leak { .. } => vec!["train", "test"],
            Self::Mode { key, .. } | Self::Value { key, .. } => vec![key],
            // Keys are named between backticks.
            Self::Memory(MemoryError { keys, .. }) => keys.split('`').skip(1).step_by(2).collect(),
            Self::NoDemos => vec!["algorithm"],
            Self::Settings { key, .. } => key.as_deref().into_iter().collect(),
        }
    }
}

/// Converts a learner's error about its settings.
pub(super) fn settings(error: LearnError) -> ExperimentError {
    match error {
        LearnError::Setting(error) => {
            ExperimentError::Settings { key: Some(error.path.to_owned()), words: error.to_string() }
        }
        LearnError::Config(words) => ExperimentError::Settings { key: None, words },
        other => ExperimentError::Settings { key: None, words: other.to_string() },
    }
}

/// Converts the error of a value that is out of its range.
pub(super) fn out_of_range(error: SettingError) -> ExperimentError {
    let SettingError { path, value, why } = error;
    ExperimentError::Value { key: path, value: value.unwrap_or_default(), why }
}

pub(super) fn refuse(key: &'static str, value: impl ToString, why: impl Into<String>) -> Result<(), ExperimentError> {
    Err(ExperimentError::Value { key, value: value.to_string(), why: why.into() })
}

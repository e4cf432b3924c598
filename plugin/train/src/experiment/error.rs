//! Errors of experiment files and of `--set`, with their positions.

use crate::experiment::checks::ExperimentError;
use playbot_harness::{brief::brief, level_files::read::shown_path};
use playbot_learner::HasExitCode;
use std::{
    io,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// An experiment that cannot be used. Very long quotations are cut short.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}{}", shown_path(path), way_out(path, source))]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The text is not an experiment.
    #[error("{}:{line}:{column}: {}", shown_path(path), brief(message))]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// The error, with the nearest valid key where a key is unknown.
        message: String,
    },
    /// A text `key=value` is wrong.
    #[error("`{}`: {}", brief(set), brief(message))]
    Set {
        /// The text.
        set: String,
        /// The error.
        message: String,
    },
    /// A text `key=value` contradicts the rest of the experiment, which was valid before.
    #[error("{}", brief(&of_sets(sets, source)))]
    Sets {
        /// The texts: the wrong ones if they are known, else all.
        sets: Vec<String>,
        /// Why.
        source: Box<ExperimentError>,
    },
    /// The values contradict one another.
    #[error("{}:{}:{}: {}", shown_path(path), at.0, at.1, brief(&source.to_string()))]
    Values {
        /// The file.
        path: PathBuf,
        /// Line and column of the wrong key, from 1; 1 and 1 if the file leaves that key out.
        at: (usize, usize),
        /// Why.
        source: Box<ExperimentError>,
    },
}

impl HasExitCode for ConfigError {}

/// Returns the advice about a missing file.
fn way_out(path: &Path, error: &io::Error) -> String {
    if error.kind() != io::ErrorKind::NotFound {
        return String::new();
    }
    format!("; name an experiment file that exists, or begin one with `playbot config show --out {}`", path.display())
}

/// Formats the texts `key=value` and their error, without naming the key twice.
fn of_sets(sets: &[String], error: &ExperimentError) -> String {
    let shown = sets.join("`, `");
    match (sets, error) {
        ([set], ExperimentError::Value { key, value, why }) if *set == format!("{key}={value}") => {
            format!("`{shown}`: {why}")
        }
        _ => format!("`{shown}`: {error}"),
    }
}

/// Origin of a value.
#[derive(Clone, Debug)]
pub(crate) enum Origin {
    /// In a file, at these lines and columns.
    File {
        /// The file.
        path: PathBuf,
        /// Line and column of the key.
        key: (usize, usize),
        /// Line and column of the value.
        value: (usize, usize),
    },
    /// In a text `key=value`.
    Set(String),
}

impl Origin {
    pub(crate) fn start_of(path: &Path) -> Self {
        Self::File { path: path.into(), key: (1, 1), value: (1, 1) }
    }

    /// Makes an error at a line and column of the value, both from 1.
    pub(crate) fn error(&self, (line, column): (usize, usize), message: String) -> ConfigError {
        match self {
            Self::File { path, value, .. } => ConfigError::Syntax {
                path: path.clone(),
                line: value.0 + line - 1,
                column: if line == 1 { value.1 + column - 1 } else { column },
                message,
            },
            Self::Set(set) => ConfigError::Set { set: set.clone(), message },
        }
    }

    /// Makes an error of the key itself.
    pub(crate) fn key_error(&self, message: String) -> ConfigError {
        match self {
            Self::File { path, key, .. } => {
                ConfigError::Syntax { path: path.clone(), line: key.0, column: key.1, message }
            }
            Self::Set(set) => ConfigError::Set { set: set.clone(), message },
        }
    }
}

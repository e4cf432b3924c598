//! Where the values of an experiment were written.

use std::path::{Path, PathBuf};

use super::config_error::ConfigError;

/// Where a value was written.
#[derive(Clone, Debug)]
pub(super) enum Origin {
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
    pub(super) fn start_of(path: &Path) -> Self {
        Self::File { path: path.into(), key: (1, 1), value: (1, 1) }
    }

    /// An error at a line and column of the value, both from 1.
    pub(super) fn error(&self, (line, column): (usize, usize), message: String) -> ConfigError {
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

    /// An error of the key itself.
    pub(super) fn key_error(&self, message: String) -> ConfigError {
        match self {
            Self::File { path, key, .. } => {
                ConfigError::Syntax { path: path.clone(), line: key.0, column: key.1, message }
            }
            Self::Set(set) => ConfigError::Set { set: set.clone(), message },
        }
    }
}

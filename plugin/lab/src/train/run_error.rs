//! Errors of the folder of a run.

use std::{
    io,
    path::{Path, PathBuf},
};

use playbot_learner::{FileError, HasExitCode};
use thiserror::Error;

use super::{config_error::ConfigError, train_error::TrainError};
use crate::sealed_file::SealedFileError;

/// Failure to use the folder of a run.
#[derive(Debug, Error)]
pub enum RunError {
    /// The folder exists already.
    #[error("{} exists already: choose another --run, go on with --resume, or overwrite with --force", .0.display())]
    Exists(PathBuf),
    /// The folder is not a run.
    #[error("no run at {}: {advice}", path.display())]
    NoRun {
        /// Path of the folder.
        path: PathBuf,
        /// The present content of the folder, and the remedy.
        advice: String,
    },
    /// The folder to overwrite is not a run.
    #[error("{} is not the folder of a run, so it is left alone: choose another --run", .0.display())]
    NotARun(PathBuf),
    /// Another process trains in the folder.
    #[error(
        "{} is in use by another process that trains there: wait for it or stop it, or choose another folder", .0.display()
    )]
    Busy(PathBuf),
    /// The checkpoint is missing.
    #[error("{} has {}", path.display(), list_steps(steps))]
    NoCheckpoint {
        /// The folder of the run.
        path: PathBuf,
        /// Environment steps of the existing checkpoints.
        steps: Vec<u64>,
    },
    /// The operating system refused.
    #[error("cannot {action} {}: {source}{}", path.display(), elsewhere(action))]
    Io {
        /// The failed action.
        action: &'static str,
        /// Its file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// A file of the run is damaged.
    #[error("{}: {message}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The damage.
        message: String,
    },
    /// The learner's file cannot be read or written.
    #[error(transparent)]
    Learner(#[from] FileError),
    /// The saved experiment cannot be read.
    #[error("{}", of_run(.0))]
    Config(#[from] ConfigError),
    /// The saved training does not fit the game.
    #[error(transparent)]
    Train(#[from] TrainError),
}

impl HasExitCode for RunError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Io { .. } => 2,
            Self::Learner(error) => error.exit_code(),
            Self::Train(error) => error.exit_code(),
            _ => 3,
        }
    }
}

impl From<SealedFileError> for RunError {
    fn from(error: SealedFileError) -> Self {
        match error {
            SealedFileError::Io { action, path, source } => Self::Io { action, path, source },
            SealedFileError::Damaged { path, message } => Self::Damaged { path, message },
        }
    }
}

/// Remedy for a run whose description is damaged.
pub const MEND: &str = "bring it back from a copy, or train the run anew with --force";

/// Converts an error of a run's saved experiment to text.
fn of_run(error: &ConfigError) -> String {
    format!("{error}; the file is part of a run: {MEND}")
}

/// Action of making the run's folder; a failure here loses nothing.
pub(super) const FOLDER: &str = "create the folder";

fn elsewhere(action: &str) -> &'static str {
    if action == FOLDER { "; make room or grant write access there, or name another folder" } else { "" }
}

fn list_steps(steps: &[u64]) -> String {
    if steps.is_empty() {
        return "no checkpoint: wait until training has saved one, restore the checkpoints from a copy, or train again with \
                --force"
            .to_owned();
    }
    let steps: Vec<_> = steps.iter().map(u64::to_string).collect();
    format!("no such checkpoint; the run has those of the steps {}", steps.join(", "))
}

/// Makes the error of a failed action on a file.
pub(super) fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> RunError {
    move |source| RunError::Io { action, path: path.into(), source }
}

/// Makes the error of a damaged file that a run needs.
pub(super) fn unreadable(path: PathBuf, message: &str) -> RunError {
    let known = message.strip_prefix("the file is damaged: ").unwrap_or(message);
    RunError::Damaged { path, message: format!("the file is damaged ({known}): {MEND}") }
}

/// Makes the error of a run's experiment that was changed on disk.
pub(super) fn edited(path: PathBuf, message: &str) -> RunError {
    let message = format!(
        "{message}; the file is part of a run: {MEND}. If you have edited it, write the change as --set for a new run \
         instead"
    );
    RunError::Damaged { path, message }
}

pub(super) fn damaged(path: &Path, error: &impl ToString) -> RunError {
    RunError::Damaged { path: path.into(), message: error.to_string() }
}

//! What can go wrong with the folder of a run.

use std::{
    io,
    path::{Path, PathBuf},
};

use playbot_learner::FileError;
use thiserror::Error;

use super::{config_file::ConfigError, train_error::TrainError};

/// A run's folder cannot be used.
#[derive(Debug, Error)]
pub enum RunError {
    /// The folder exists already.
    #[error("{} exists already: choose another --run, go on with --resume, or overwrite with --force", .0.display())]
    Exists(PathBuf),
    /// There is no run to look at or to go on with.
    #[error("no run at {}: {advice}", path.display())]
    NoRun {
        /// Where it was looked for.
        path: PathBuf,
        /// What is there instead, and what to do.
        advice: String,
    },
    /// The folder to overwrite is something else.
    #[error("{} is not the folder of a run, so it is left alone: choose another --run", .0.display())]
    NotARun(PathBuf),
    /// Another process trains in the folder.
    #[error(
        "{} is in use by another process that trains there: wait for it or stop it, or choose another folder", .0.display()
    )]
    Busy(PathBuf),
    /// There is no such checkpoint.
    #[error("{} has {}", path.display(), list_steps(steps))]
    NoCheckpoint {
        /// The folder of the run.
        path: PathBuf,
        /// Environment steps of those that it has.
        steps: Vec<u64>,
    },
    /// The operating system refused.
    #[error("cannot {action} {}: {source}{}", path.display(), elsewhere(action))]
    Io {
        /// What was tried.
        action: &'static str,
        /// On which file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// A file of the run is damaged.
    #[error("{}: {message}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
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

/// What to do about a run that says no longer what it is.
pub const MEND: &str = "bring it back from a copy, or train the run anew with --force";

/// What is wrong with the experiment that a run has saved.
fn of_run(error: &ConfigError) -> String {
    format!("{error}; the file is part of a run: {MEND}")
}

/// What is made where the folder of a run is made; nothing is lost yet if that fails.
pub(super) const FOLDER: &str = "create the folder";

fn elsewhere(action: &str) -> &'static str {
    if action == FOLDER { "; make room or rights there, or name another folder" } else { "" }
}

fn list_steps(steps: &[u64]) -> String {
    if steps.is_empty() {
        return "no checkpoint: wait until its training has saved one, bring back what it had from a copy, or start it again \
                with --force"
            .to_owned();
    }
    let steps: Vec<_> = steps.iter().map(u64::to_string).collect();
    format!("no such checkpoint; it has those of the steps {}", steps.join(", "))
}

pub(super) fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> RunError {
    move |source| RunError::Io { action, path: path.into(), source }
}

/// A file without which a run is none.
pub(super) fn unreadable(path: &Path, error: &impl ToString) -> RunError {
    let error = error.to_string();
    let known = error.strip_prefix("the file is damaged: ").unwrap_or(&error);
    RunError::Damaged { path: path.into(), message: format!("the file is damaged ({known}): {MEND}") }
}

/// The experiment of a run, which is not as it was written.
pub(super) fn edited(path: &Path, message: &str) -> RunError {
    let message = format!(
        "{message}; the file is part of a run: {MEND}. If you have edited it, write the change as --set in a training of its \
         own instead"
    );
    RunError::Damaged { path: path.into(), message }
}

pub(super) fn damaged(path: &Path, error: &impl ToString) -> RunError {
    RunError::Damaged { path: path.into(), message: error.to_string() }
}

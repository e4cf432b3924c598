//! Errors of reading runs.

use std::{io, path::PathBuf};

use playbot_learner::HasExitCode;
use thiserror::Error;

use crate::train::run_dir::RunError;
use bevy_playbot::unknown_name::UnknownName;

/// A run that cannot be read, or that lacks the requested metric.
#[derive(Debug, Error)]
pub enum RunsError {
    /// The folder is missing.
    #[error(
        "there is no folder {}: name the folder of your runs, or train one with `playbot train --run {}`",
        .0.display(), .0.join("first").display()
    )]
    Missing(PathBuf),
    /// No run in the folder or below it.
    #[error("no runs in {}: train one with `playbot train --run {}`", .0.display(), .0.join("first").display())]
    NoRuns(PathBuf),
    /// No update has been logged yet.
    #[error("{} has no metrics yet: they begin with the first finished update", .0.display())]
    NoMetrics(PathBuf),
    /// The run lacks this metric.
    #[error("{}: {source}", path.display())]
    Metric {
        /// Path of the run, or of the first of several.
        path: PathBuf,
        /// The metrics of the run.
        source: UnknownName,
    },
    /// A folder that cannot be listed, or a file that cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// Path of the file or folder.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// A missing run, or one with a damaged description.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl HasExitCode for RunsError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Io { .. } => 2,
            Self::Run(error) => error.exit_code(),
            _ => 3,
        }
    }
}

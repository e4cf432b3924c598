//! Why runs cannot be looked at.

use std::{io, path::PathBuf};

use thiserror::Error;

use crate::train::run_dir::RunError;
use bevy_playbot::unknown_name::UnknownName;

/// A run cannot be read, or does not hold what was asked for.
#[derive(Debug, Error)]
pub enum RunsError {
    /// There is no such folder.
    #[error(
        "there is no folder {}: name the one that your runs are in, or train one with `playbot train --run {}`",
        .0.display(), .0.join("first").display()
    )]
    Missing(PathBuf),
    /// No run in the folder or below it.
    #[error("no runs in {}: train one with `playbot train --run {}`", .0.display(), .0.join("first").display())]
    NoRuns(PathBuf),
    /// The first update has not been logged.
    #[error("{} has no metrics yet: they begin with the first finished update", .0.display())]
    NoMetrics(PathBuf),
    /// The run does not have this metric.
    #[error("{}: {source}", path.display())]
    Metric {
        /// The run, or the first of several.
        path: PathBuf,
        /// The metrics there are.
        source: UnknownName,
    },
    /// A folder cannot be listed or a file not be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// There is no such run, or its description is damaged.
    #[error(transparent)]
    Run(#[from] RunError),
}

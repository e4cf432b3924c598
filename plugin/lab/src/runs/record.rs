//! A run on disk.

use std::{
    fs,
    path::{Path, PathBuf},
    time::SystemTime,
};

use super::{
    curves::{RunCurves, check_metric},
    error::RunsError,
};
use crate::train::{
    Experiment,
    checkpoint::{self, Checkpoint},
    run_dir::{OpenedRun, RunDir, RunInfo},
    run_lock::RunLock,
};

/// Configuration and progress of a run.
#[derive(Clone, Debug)]
pub struct RunRecord {
    /// Its folder.
    pub path: PathBuf,
    /// Its experiment, with all defaults filled in.
    pub experiment: Experiment,
    /// Algorithm, seed and version.
    pub info: RunInfo,
    /// Its metrics.
    pub curves: RunCurves,
    /// Its checkpoints, the oldest first.
    pub checkpoints: Vec<Checkpoint>,
    /// True while it is being trained.
    pub is_training: bool,
    /// Time of the last log entry, if the system keeps it.
    pub updated: Option<SystemTime>,
}

impl RunRecord {
    /// Reads the run in a folder.
    ///
    /// # Errors
    ///
    /// [`RunsError`] if the folder is not a run or one of its files is damaged.
    pub fn read(path: &Path) -> Result<Self, RunsError> {
        let OpenedRun { run, experiment, info } = RunDir::open(path)?;
        let log = run.metrics_log();
        let modified = |file: &Path| fs::metadata(file).and_then(|data| data.modified()).ok();
        Ok(Self {
            path: path.into(),
            experiment,
            info,
            curves: RunCurves::read(path)?,
            checkpoints: checkpoint::list(path)?,
            is_training: RunLock::is_taken(path),
            updated: modified(log.metrics_file()).or_else(|| modified(&path.join("run.json"))),
        })
    }

    /// Returns whether all steps of the experiment are done and saved.
    pub fn is_finished(&self) -> bool {
        self.checkpoints.last().is_some_and(|last| last.summary.step >= self.experiment.steps)
    }

    /// Returns the environment steps done: while it is being trained the logged ones, otherwise those of the last
    /// checkpoint. A resumed run starts from there, and later log entries are lost.
    pub fn steps(&self) -> u64 {
        match self.checkpoints.last() {
            Some(last) if !self.is_training => last.summary.step,
            _ => self.curves.last_step(),
        }
    }

    /// Returns the curve of a metric.
    ///
    /// # Errors
    ///
    /// [`RunsError::NoMetrics`], or [`RunsError::Metric`] with the nearest metric.
    pub fn curve(&self, tag: &str) -> Result<&[(u64, f64)], RunsError> {
        if self.curves.last_step() == 0 {
            return Err(RunsError::NoMetrics(self.path.clone()));
        }
        check_metric(tag, std::iter::once(&self.curves))
            .map_err(|source| RunsError::Metric { path: self.path.clone(), source })?;
        Ok(self.curves.curve(tag))
    }
}

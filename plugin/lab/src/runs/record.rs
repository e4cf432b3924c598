//! One run as it lies on the disk.

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

/// What a run is and what it has reached.
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
    /// Whether it is trained at this moment.
    pub is_training: bool,
    /// When it was last logged to, where the system says so.
    pub updated: Option<SystemTime>,
}

impl RunRecord {
    /// Reads the run in a folder.
    ///
    /// # Errors
    ///
    /// [`RunsError`] if the folder is not that of a run or a file of it is damaged.
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

    /// Whether all steps of the experiment are done and saved.
    pub fn is_finished(&self) -> bool {
        self.checkpoints.last().is_some_and(|last| last.summary.step >= self.experiment.steps)
    }

    /// Environment steps that are done: while it is trained those that are logged, and otherwise those of the last
    /// checkpoint, from which it goes on. What is logged after that is lost.
    pub fn steps(&self) -> u64 {
        match self.checkpoints.last() {
            Some(last) if !self.is_training => last.summary.step,
            _ => self.curves.last_step(),
        }
    }

    /// The curve of a metric.
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

//! Runs on disk: finding them, reading their metrics, comparing them over seeds.
//!
//! - [`find_runs`] finds the folders of runs, and [`RunRecord`] reads one of them. [`FoundRuns`] has leftovers, too.
//! - [`RunCurves`] has the learning curves of a run by their TensorBoard tags.
//! - [`group_runs`] groups runs that differ only in their seed, and [`GroupStatistics`] measures each group.
//!
//! Runs are only read, so training may go on at the same time.
//!
//! The folder, in reading order:
//!
//! - `curves`: the learning curves of a run.
//! - `group`: groups of runs that differ only in their seed, and their statistics.

mod curves;
pub mod group;

use crate::{
    Experiment, checkpoint,
    checkpoint::Checkpoint,
    run_dir::{OpenedRun, RunDir, RunError, RunInfo, RunLock, run_of_leftover},
    runs::curves::check_metric,
};
use bevy_playbot::unknown_name::UnknownName;
use playbot_harness::brief::shell_word;
use playbot_learner::HasExitCode;
use std::{
    fmt, fs, io,
    path::{Path, PathBuf},
    time::SystemTime,
};
use thiserror::Error;

pub use crate::runs::{
    curves::RunCurves,
    group::{
        GroupStatistics, RunGroup, changed_settings, group_runs, mean_and_spread, settings, settings_that_differ,
        with_defaults,
    },
};

/// Files and folders that only a run has. One is enough to find a run, even if the others are lost.
const SIGNS: [&str; 3] = ["run.json", "metrics.jsonl", "checkpoints"];

/// Runs and leftovers at a path or below it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FoundRuns {
    /// The folders of runs, sorted by path, whole or damaged.
    pub runs: Vec<PathBuf>,
    /// Leftovers of replaced runs, sorted by path. They are not runs: the next training in the folder removes them.
    pub leftovers: Vec<Leftover>,
}

impl FoundRuns {
    /// Searches `root` and, if it is not a run, all folders below it. Runs are not searched for further runs, and
    /// links to folders are not followed.
    ///
    /// # Errors
    ///
    /// [`RunsError::Missing`]; [`RunsError::NoRuns`] if neither runs nor leftovers are found; [`RunsError::Io`] for a
    /// folder that cannot be listed.
    pub fn at(root: &Path) -> Result<Self, RunsError> {
        if !root.is_dir() {
            return Err(RunsError::Missing(root.into()));
        }
        let (mut found, mut folders) = (Self::default(), vec![root.to_owned()]);
        while let Some(folder) = folders.pop() {
            if SIGNS.iter().any(|sign| folder.join(sign).exists()) {
                found.runs.push(folder);
                continue;
            }
            for below in folders_in(&folder).map_err(|source| RunsError::Io { path: folder, source })? {
                match Leftover::of(&below) {
                    Some(leftover) => found.leftovers.push(leftover),
                    None => folders.push(below),
                }
            }
        }
        if found == Self::default() {
            return Err(RunsError::NoRuns(root.into()));
        }
        found.runs.sort();
        found.leftovers.sort_by(|one, other| one.folder.cmp(&other.folder));
        Ok(found)
    }
}

/// Returns the folders of runs at `root`: itself, or all below it, see [`FoundRuns::at`].
///
/// # Errors
///
/// As for [`FoundRuns::at`], and [`RunsError::NoRuns`] if only leftovers are found.
pub fn find_runs(root: &Path) -> Result<Vec<PathBuf>, RunsError> {
    let runs = FoundRuns::at(root)?.runs;
    if runs.is_empty() { Err(RunsError::NoRuns(root.into())) } else { Ok(runs) }
}

fn folders_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut folders = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            folders.push(entry.path());
        }
    }
    Ok(folders)
}

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

/// Parts of a run that a process moved aside to replace it, and did not remove, for instance because it was killed.
/// Its text form names the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Leftover {
    /// Folder of the parts.
    pub folder: PathBuf,
    /// Folder of the replaced run.
    pub run: PathBuf,
}

impl Leftover {
    /// Recognises a leftover by its folder's name; `None` for any other folder.
    fn of(folder: &Path) -> Option<Self> {
        Some(Self { folder: folder.into(), run: run_of_leftover(folder)? })
    }
}

impl fmt::Display for Leftover {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (folder, run) = (self.folder.display(), self.run.display());
        write!(f, "{folder} holds old files of {run}, ")?;
        if RunLock::is_taken(&self.run) {
            return write!(f, "which a process is replacing: look again when it has ended");
        }
        if !self.run.is_dir() {
            return write!(f, "which is gone: rename {folder} to that name to get the run back, or delete it");
        }
        let run = shell_word(&run.to_string());
        write!(
            f,
            "whose replacement was stopped: `playbot train --run {run} --resume` brings the old run back, or removes it \
             if the new one has begun"
        )
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn runs_are_found_whole_or_damaged() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path();
        for path in ["b/seed-2", "b/seed-1/tensorboard", "lost/checkpoints", "a", "empty/deep"] {
            fs::create_dir_all(root.join(path)).expect("created");
        }
        for file in ["b/seed-2/run.json", "b/seed-1/metrics.jsonl", "a/run.json", "empty/notes.txt"] {
            fs::write(root.join(file), "").expect("written");
        }
        let found = find_runs(root).expect("found");
        assert_eq!(found, ["a", "b/seed-1", "b/seed-2", "lost"].map(|name| root.join(name)));
        assert_eq!(find_runs(&root.join("a")).expect("itself"), [root.join("a")]);
        assert!(matches!(find_runs(&root.join("empty")), Err(RunsError::NoRuns(_))));
        assert!(matches!(find_runs(&root.join("missing")), Err(RunsError::Missing(_))));
    }

    #[test]
    fn what_is_left_of_a_run_is_named_and_is_no_run() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path();
        for path in ["b/seed-1", "b/seed-1.replaced-7", "a.replaced-31", "c.replaced-it"] {
            fs::create_dir_all(root.join(path)).expect("created");
            fs::write(root.join(path).join("run.json"), "").expect("written");
        }
        let found = FoundRuns::at(root).expect("found");
        assert_eq!(found.runs, ["b/seed-1", "c.replaced-it"].map(|name| root.join(name)));
        let folders: Vec<&Path> = found.leftovers.iter().map(|leftover| leftover.folder.as_path()).collect();
        assert_eq!(folders, [root.join("a.replaced-31"), root.join("b/seed-1.replaced-7")]);
        assert_eq!(find_runs(root).expect("found"), found.runs);
        // A leftover alone is reported too.
        fs::remove_dir_all(root.join("b")).expect("removed");
        fs::remove_dir_all(root.join("c.replaced-it")).expect("removed");
        assert!(FoundRuns::at(root).expect("found").runs.is_empty());
        assert!(matches!(find_runs(root), Err(RunsError::NoRuns(_))));
    }

    #[test]
    fn what_to_do_depends_on_what_is_in_the_place_of_the_run() {
        let parent = tempfile::tempdir().expect("a folder");
        let (folder, run) = (parent.path().join("a.replaced-12"), parent.path().join("a"));
        let left = Leftover::of(&folder).expect("its name says so");
        assert_eq!(left, Leftover { folder, run: run.clone() });
        assert_eq!(Leftover::of(&run), None);
        assert!(left.to_string().contains("is gone: rename"), "{left}");
        fs::create_dir(&run).expect("writable");
        let words = left.to_string();
        assert!(
            words.contains("a.replaced-12 holds old files of ") && words.contains("--resume` brings the old"),
            "{words}"
        );
        let _lock = RunLock::take(&run).expect("free");
        assert!(left.to_string().contains("look again when it has ended"), "{left}");
    }
}

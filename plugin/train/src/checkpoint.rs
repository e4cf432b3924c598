//! Checkpoints of a run: their files, their retention, the last and the best.
//!
//! ```text
//! checkpoints/step-000000081920/learner.safetensors   weights, moments, normalisers, generators
//! checkpoints/step-000000081920/arenas.json           level queues and running episodes
//! checkpoints/step-000000081920/summary.json          return and success rate of the policy
//! ```
//!
//! A folder called `step-…` is whole: it is filled under another name first.

use crate::error::RunError;
use bevy_playbot::unknown_name::UnknownName;
use playbot_harness::sealed_file::{SealedFileError, io_error, read_sealed, write_sealed};
use playbot_learner::disk;
use serde::{Deserialize, Serialize};
use std::{
    fs, io,
    path::{Path, PathBuf},
    str::FromStr,
};

const PREFIX: &str = "step-";

const SUMMARY: &str = "summary.json";

const UNFINISHED: &str = "unfinished";

/// Name of a checkpoint while it is deleted, which keeps a partial one from passing as whole.
const REMOVED: &str = "removed";

/// Training results of a checkpoint's policy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CheckpointSummary {
    /// Environment steps done.
    pub step: u64,
    /// Mean return of the last 100 training episodes; `None` before as many have ended.
    pub episodic_return: Option<f64>,
    /// Success rate of the last 100 training episodes; `None` before as many have ended.
    pub success_rate: Option<f64>,
    /// Elo rating of the policy against its rivals, as of this step; `None` without rivals, or if it is no snapshot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub elo: Option<f64>,
}

/// One whole checkpoint.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Its folder.
    pub path: PathBuf,
    /// Its training results.
    pub summary: CheckpointSummary,
}

impl Checkpoint {
    /// Returns the path of the learner's file.
    pub fn learner_file(&self) -> PathBuf {
        self.path.join("learner.safetensors")
    }

    /// Returns the path of the arenas' file.
    pub fn arenas_file(&self) -> PathBuf {
        self.path.join("arenas.json")
    }
}

/// The checkpoint of a run to use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CheckpointChoice {
    /// The latest.
    #[default]
    Last,
    /// The one with the highest return in training; of a training against rivals the one with the highest rating.
    Best,
    /// The one at this step.
    Step(u64),
}

impl FromStr for CheckpointChoice {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        match name {
            "last" => Ok(Self::Last),
            "best" => Ok(Self::Best),
            step => step.parse().map(Self::Step).map_err(|_| {
                UnknownName::new("checkpoint", name, &["last", "best", "the number of environment steps of one"])
            }),
        }
    }
}

/// Lists all whole checkpoints of the run in folder `run`, the oldest first. Those with an unreadable summary are
/// skipped with a warning, which names the last whole one.
///
/// # Errors
///
/// [`RunError`] if the folder cannot be read.
pub fn list(run: &Path) -> Result<Vec<Checkpoint>, RunError> {
    let folder = folder(run);
    let entries = match fs::read_dir(&folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(io_error("read", &folder))?,
    };
    let (mut checkpoints, mut damaged) = (Vec::new(), Vec::new());
    for entry in entries {
        let path = entry.map_err(io_error("read", &folder))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name.strip_prefix(PREFIX).is_some_and(|step| step.parse::<u64>().is_ok()) {
            match read_sealed(&path.join(SUMMARY)) {
                Ok((summary, _)) => checkpoints.push(Checkpoint { path, summary }),
                Err(error) => damaged.push(error),
            }
        }
    }
    checkpoints.sort_by_key(|checkpoint| checkpoint.summary.step);
    let last = last_whole(&checkpoints);
    damaged.iter().for_each(|error| tracing::warn!("a checkpoint is passed over: {error}; {last}"));
    Ok(checkpoints)
}

/// Describes the last whole checkpoint beside a damaged one.
fn last_whole(checkpoints: &[Checkpoint]) -> String {
    checkpoints.last().map_or("no whole checkpoint is left".to_owned(), |checkpoint| {
        format!("the last whole one is that of step {}", checkpoint.summary.step)
    })
}

/// Returns the requested checkpoint out of those of [`list`].
///
/// # Errors
///
/// [`RunError::NoCheckpoint`] if the run has no checkpoint, or none at that step.
pub fn choose(run: &Path, choice: CheckpointChoice) -> Result<Checkpoint, RunError> {
    let mut all = list(run)?;
    let index = match choice {
        CheckpointChoice::Last => all.len().checked_sub(1),
        CheckpointChoice::Best => best(&all),
        CheckpointChoice::Step(step) => all.iter().position(|checkpoint| checkpoint.summary.step == step),
    };
    let steps = all.iter().map(|checkpoint| checkpoint.summary.step).collect();
    match index {
        Some(index) => Ok(all.swap_remove(index)),
        None => Err(RunError::NoCheckpoint { path: run.into(), steps }),
    }
}

/// Writes a checkpoint: `fill` writes the large files into the folder that it is given. Afterwards only the last
/// `keep` and the best stay.
///
/// # Errors
///
/// [`RunError`]; all earlier checkpoints still exist then.
pub(crate) fn write(
    run: &Path,
    summary: CheckpointSummary,
    keep: usize,
    fill: impl FnOnce(&Checkpoint) -> Result<(), RunError>,
) -> Result<(), RunError> {
    let folder = folder(run);
    let fresh = Checkpoint { path: folder.join(UNFINISHED), summary };
    let path = folder.join(format!("{PREFIX}{:012}", summary.step));
    remove_if_there(&fresh.path)?;
    disk::create_dir_all(&fresh.path).map_err(io_error("create", &fresh.path))?;
    let filled = fill(&fresh).and_then(|()| Ok(write_sealed(&fresh.path.join(SUMMARY), &summary)?));
    if filled.is_err() {
        // Frees the space; the first error is reported.
        let _ = remove_if_there(&fresh.path);
        return filled;
    }
    put_aside(&path)?;
    disk::rename(&fresh.path, &path).map_err(io_error("move", &fresh.path))?;
    prune(run, keep)
}

/// Renames the checkpoints after `step`, so they are not listed: they were unreadable when training resumed.
pub(crate) fn set_aside_after(run: &Path, step: u64) -> Result<(), RunError> {
    for checkpoint in list(run)?.iter().filter(|checkpoint| checkpoint.summary.step > step) {
        put_aside(&checkpoint.path)?;
    }
    Ok(())
}

/// Removes partial checkpoints of a process that was killed while it wrote or removed one.
pub(crate) fn remove_halves(run: &Path) -> Result<(), SealedFileError> {
    [UNFINISHED, REMOVED].iter().try_for_each(|half| remove_if_there(&folder(run).join(half)))
}

/// Renames a checkpoint, if it exists, to a name that is not listed, for manual inspection.
fn put_aside(path: &Path) -> Result<(), SealedFileError> {
    if !path.exists() {
        return Ok(());
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let aside = path.with_file_name(format!("damaged-{name}"));
    remove_if_there(&aside)?;
    disk::rename(path, &aside).map_err(io_error("move", path))
}

/// Removes all but the last `keep` (at least one) and the best.
fn prune(run: &Path, keep: usize) -> Result<(), RunError> {
    // A killed process may have left this folder.
    remove_if_there(&folder(run).join(REMOVED))?;
    let all = list(run)?;
    let best = best(&all);
    let old = all.len().saturating_sub(keep.max(1));
    for (index, checkpoint) in all.iter().enumerate().take(old) {
        if Some(index) != best {
            let removed = folder(run).join(REMOVED);
            disk::rename(&checkpoint.path, &removed).map_err(io_error("move", &checkpoint.path))?;
            remove_if_there(&removed)?;
        }
    }
    Ok(())
}

/// Returns the index of the checkpoint with the highest rating, or without ratings that with the highest return; the
/// latest of equals. Against rivals a return says little: the rivals get better, too.
fn best(all: &[Checkpoint]) -> Option<usize> {
    let is_rated = all.iter().any(|checkpoint| checkpoint.summary.elo.is_some());
    let value = |index: &usize| {
        let CheckpointSummary { elo, episodic_return, .. } = all[*index].summary;
        if is_rated { elo } else { episodic_return }.unwrap_or(f64::NEG_INFINITY)
    };
    (0..all.len()).max_by(|a, b| value(a).total_cmp(&value(b)))
}

fn folder(run: &Path) -> PathBuf {
    run.join("checkpoints")
}

fn remove_if_there(folder: &Path) -> Result<(), SealedFileError> {
    match disk::remove_dir_all(folder) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(io_error("remove", folder)(error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_harness::sealed_file::write_atomically;

    fn save(run: &Path, step: u64, episodic_return: f64, keep: usize) -> Result<(), RunError> {
        let summary =
            CheckpointSummary { step, episodic_return: Some(episodic_return), ..CheckpointSummary::default() };
        write(run, summary, keep, |checkpoint| Ok(write_atomically(&checkpoint.learner_file(), b"weights")?))
    }

    fn steps(run: &Path) -> Vec<u64> {
        list(run).expect("readable").iter().map(|checkpoint| checkpoint.summary.step).collect()
    }

    #[test]
    fn the_best_against_rivals_is_the_highest_rated() {
        let run = tempfile::tempdir().expect("a folder");
        let values = [(10, 0.9, Some(1000.0)), (20, 0.1, Some(1300.0)), (25, 0.9, None), (30, 0.2, Some(1200.0))];
        for (step, value, elo) in values {
            let summary = CheckpointSummary { step, episodic_return: Some(value), elo, ..CheckpointSummary::default() };
            let filled = |checkpoint: &Checkpoint| Ok(write_atomically(&checkpoint.learner_file(), b"weights")?);
            write(run.path(), summary, 1, filled).expect("writable");
        }
        assert_eq!(steps(run.path()), [20, 30]);
        assert_eq!(choose(run.path(), CheckpointChoice::Best).expect("there").summary.step, 20);
    }

    #[test]
    fn the_last_and_the_best_stay() {
        let run = tempfile::tempdir().expect("a folder");
        for (step, value) in [(10, 1.0), (20, 9.0), (30, 2.0), (40, 3.0), (50, 4.0)] {
            save(run.path(), step, value, 2).expect("writable");
        }
        assert_eq!(steps(run.path()), [20, 40, 50]);
        let chosen = |choice| choose(run.path(), choice).map(|checkpoint| checkpoint.summary.step);
        assert_eq!(chosen(CheckpointChoice::Last).expect("there"), 50);
        assert_eq!(chosen(CheckpointChoice::Best).expect("there"), 20);
        assert_eq!(chosen(CheckpointChoice::Step(40)).expect("there"), 40);
        let missing = chosen(CheckpointChoice::Step(30)).expect_err("pruned").to_string();
        assert!(missing.contains("20, 40, 50"), "{missing}");
    }

    #[test]
    fn a_checkpoint_that_fails_leaves_the_old_one_and_no_rubbish() {
        let run = tempfile::tempdir().expect("a folder");
        save(run.path(), 10, 1.0, 1).expect("writable");
        let summary = CheckpointSummary { step: 20, ..CheckpointSummary::default() };
        let failed = write(run.path(), summary, 1, |checkpoint| {
            write_atomically(&checkpoint.learner_file(), b"half")?;
            Err(io_error("write", &checkpoint.arenas_file())(io::Error::from(io::ErrorKind::StorageFull)).into())
        });
        assert!(failed.is_err());
        assert_eq!(steps(run.path()), [10]);
        assert_eq!(fs::read_dir(folder(run.path())).expect("there").count(), 1);
    }

    #[test]
    fn a_half_written_checkpoint_is_not_seen() {
        let run = tempfile::tempdir().expect("a folder");
        let half = folder(run.path()).join(UNFINISHED);
        fs::create_dir_all(&half).expect("writable");
        fs::write(half.join("learner.safetensors"), b"half").expect("writable");
        assert!(matches!(choose(run.path(), CheckpointChoice::Last), Err(RunError::NoCheckpoint { .. })));
        save(run.path(), 10, 1.0, 1).expect("writable");
        assert_eq!(steps(run.path()), [10]);
    }

    #[test]
    fn beside_a_damaged_checkpoint_it_is_said_what_is_left() {
        let run = tempfile::tempdir().expect("a folder");
        save(run.path(), 10, 1.0, 3).expect("writable");
        save(run.path(), 20, 1.0, 3).expect("writable");
        fs::write(list(run.path()).expect("readable")[1].path.join(SUMMARY), "{").expect("writable");
        let whole = list(run.path()).expect("readable");
        assert_eq!(last_whole(&whole), "the last whole one is that of step 10");
        assert_eq!(last_whole(&[]), "no whole checkpoint is left");
    }

    #[test]
    fn what_could_not_be_read_is_neither_the_last_nor_the_best() {
        let run = tempfile::tempdir().expect("a folder");
        for (step, value) in [(10, 1.0), (20, 2.0), (30, 9.0)] {
            save(run.path(), step, value, 3).expect("writable");
        }
        set_aside_after(run.path(), 20).expect("movable");
        assert_eq!(steps(run.path()), [10, 20]);
        save(run.path(), 25, 1.5, 1).expect("writable");
        assert_eq!(steps(run.path()), [20, 25], "the best and the last of those that can be read");
        assert!(folder(run.path()).join("damaged-step-000000000030").exists());
    }

    #[test]
    fn checkpoints_are_named_on_the_command_line() {
        assert_eq!("last".parse(), Ok(CheckpointChoice::Last));
        assert_eq!("best".parse(), Ok(CheckpointChoice::Best));
        assert_eq!("4096".parse(), Ok(CheckpointChoice::Step(4096)));
        assert!("newest".parse::<CheckpointChoice>().expect_err("no such word").to_string().contains("last, best"));
    }
}

//! The folder of a run: configuration, metrics, checkpoints.
//!
//! ```text
//! runs/<id>/experiment.ron     the experiment with all defaults filled in
//! runs/<id>/run.json           algorithm, seed, version
//! runs/<id>/metrics.jsonl      one line per update; the same bytes for the same seed
//! runs/<id>/timing.jsonl       seconds and steps per second of each update
//! runs/<id>/tensorboard/       both, as an event file for TensorBoard
//! runs/<id>/checkpoints/       the latest and the best, see [`checkpoint`]
//! runs/<id>/run.lock           locked during training, see [`RunLock`]
//! ```

use crate::{
    checkpoint,
    checkpoint::{Checkpoint, CheckpointChoice},
    collect::{ArenaState, restore_arenas, save_arenas},
    error::{TrainError, edited, unreadable},
    experiment::{Algorithm, Experiment, file::read_experiment},
    metrics_log::MetricsLog,
    run_lock::{RunLock, check_is_run, replace_run},
    trainer,
    trainer::{Progress, Trainer, UpdateReport, learner::TrainedLearner},
};
use playbot_harness::{
    game::Game,
    sealed_file::{
        SealedFileError, check_text_seal, damaged, read_sealed, remove_temporaries, write_atomically, write_sealed,
    },
};
use playbot_learner::{DeviceKind, SeenLevels, seal_text};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

pub use crate::{
    error::{MEND, RunError},
    run_lock::{check_new, check_replaceable, end_replacement, is_unstarted},
};

/// File of the run's experiment.
const EXPERIMENT: &str = "experiment.ron";

/// Content of `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunInfo {
    /// The algorithm.
    pub algorithm: Algorithm,
    /// The seed.
    pub seed: u64,
    /// Version of this crate.
    pub version: String,
    /// Revision of playbot's own code, if known. The game's revision is not kept, since its rules have a version.
    pub revision: String,
    /// Version of the game's rules.
    pub game_version: u32,
    /// [Checksum](playbot_harness::sealed_file::file_checksum) of the skill model's file, if the algorithm needs one.
    #[serde(default)]
    pub skills: Option<String>,
    /// The levels that it sees, with those of its recordings and its skills; missing in older runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seen: Option<SeenLevels>,
    /// Device that it was started on; the default one if the run does not name it.
    #[serde(default)]
    pub device: DeviceKind,
}

/// Saved state of training besides the learner.
#[derive(Serialize, Deserialize)]
struct TrainState {
    progress: Progress,
    arenas: Vec<Vec<ArenaState>>,
}

/// An open folder of a run.
pub struct RunDir {
    path: PathBuf,
    /// Held while the run is open for writing.
    _lock: Option<RunLock>,
}

/// An existing run, with the content of its files.
pub struct OpenedRun {
    /// The folder.
    pub run: RunDir,
    /// Its experiment, with all defaults filled in.
    pub experiment: Experiment,
    /// Content of its `run.json`.
    pub info: RunInfo,
}

impl RunDir {
    /// Makes the folder if it is missing, locks it, and writes the run's description.
    ///
    /// # Errors
    ///
    /// [`RunError::Exists`] for a run unless `force`, which replaces it; [`RunError::NotARun`] for other content;
    /// [`RunError::Busy`] for a folder in use. [`RunError::File`] if it cannot be written.
    pub fn create(path: &Path, experiment: &Experiment, info: &RunInfo, force: bool) -> Result<Self, RunError> {
        Self::begin(RunLock::of_new(path, force)?, experiment, info)
    }

    /// Writes the run's description into a locked folder. An existing run is moved aside and removed once the new one
    /// is written; it is restored if that fails.
    ///
    /// # Errors
    ///
    /// [`RunError::NotARun`] for a folder with other content; [`RunError::File`] if it cannot be written.
    pub fn begin(lock: RunLock, experiment: &Experiment, info: &RunInfo) -> Result<Self, RunError> {
        let run = Self { path: lock.folder().to_owned(), _lock: Some(lock) };
        replace_run(&run.path, || {
            run.write_experiment(experiment)?;
            Ok(write_sealed(&run.path.join("run.json"), info)?)
        })?;
        Ok(run)
    }

    /// Opens the folder of an existing run for reading.
    ///
    /// # Errors
    ///
    /// [`RunError::NoRun`] without a run; another [`RunError`] if its files are damaged.
    pub fn open(path: &Path) -> Result<OpenedRun, RunError> {
        check_is_run(path)?;
        let experiment_path = path.join(EXPERIMENT);
        check_text_seal(&experiment_path).map_err(|error| with_remedy(error, edited))?;
        let experiment = read_experiment(&experiment_path)?;
        let info_path = path.join("run.json");
        let (info, had_seal) = read_sealed(&info_path).map_err(|error| with_remedy(error, unreadable))?;
        if !had_seal {
            tracing::warn!(
                "{} was written by an older version and has no checksum: damage to it cannot be noticed",
                info_path.display()
            );
        }
        Ok(OpenedRun { run: Self { path: path.into(), _lock: None }, experiment, info })
    }

    /// Opens the folder of an existing run as [`open`](Self::open) does, to resume it.
    ///
    /// # Errors
    ///
    /// As for [`open`](Self::open), and [`RunError::Busy`].
    pub fn open_to_write(path: &Path) -> Result<OpenedRun, RunError> {
        end_replacement(path)?;
        // Only the folder of a run gets a lock file.
        Self::open(path)?;
        Self::open_with(RunLock::take(path)?)
    }

    /// Opens a locked folder as [`open`](Self::open) does, to resume the run. Removes the leftovers of killed
    /// processes.
    ///
    /// # Errors
    ///
    /// As for [`open`](Self::open).
    pub fn open_with(lock: RunLock) -> Result<OpenedRun, RunError> {
        let OpenedRun { run, experiment, info } = Self::open(lock.folder())?;
        tidy(&lock);
        Ok(OpenedRun { run: Self { _lock: Some(lock), ..run }, experiment, info })
    }

    /// Writes the experiment again, after its steps were raised.
    ///
    /// # Errors
    ///
    /// [`RunError::File`].
    pub fn write_experiment(&self, experiment: &Experiment) -> Result<(), RunError> {
        let text = experiment.to_ron().map_err(|error| damaged(&self.path, &error))?;
        Ok(write_atomically(&self.path.join(EXPERIMENT), seal_text(&text).as_bytes())?)
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns a checkpoint of the run: the policy, its prior and the state of training.
    ///
    /// # Errors
    ///
    /// [`RunError::NoCheckpoint`].
    pub fn checkpoint(&self, choice: CheckpointChoice) -> Result<Checkpoint, RunError> {
        checkpoint::choose(&self.path, choice)
    }

    /// Returns the run's metrics.
    pub fn metrics_log(&self) -> MetricsLog {
        MetricsLog::new(&self.path)
    }

    /// Appends an update to the metrics.
    ///
    /// # Errors
    ///
    /// [`RunError::File`].
    pub fn log(&self, report: &UpdateReport, steps_per_update: u64) -> Result<(), RunError> {
        Ok(self.metrics_log().append(report, steps_per_update)?)
    }

    /// Saves learner and arenas as a new checkpoint; the latest and the best of the earlier ones stay.
    ///
    /// # Errors
    ///
    /// [`RunError`]; the earlier checkpoints are still there.
    pub fn save(&self, trainer: &mut Trainer) -> Result<(), RunError> {
        self.metrics_log().sync()?;
        let keep = trainer.experiment().checkpoints.keep;
        checkpoint::write(&self.path, trainer.progress.summary(), keep, |fresh| {
            trainer.learner.save(&fresh.learner_file())?;
            let state = TrainState {
                progress: trainer.progress.clone(),
                arenas: trainer.collectors.iter_mut().map(save_arenas).collect(),
            };
            Ok(write_sealed(&fresh.arenas_file(), &state)?)
        })
    }

    /// Restores the last checkpoint, and drops metrics that were logged after it. A checkpoint that cannot be read,
    /// for instance after a disk fault, is skipped with a warning, and the one before it is used.
    ///
    /// # Errors
    ///
    /// [`RunError`] if no checkpoint exists, none can be read, or the checkpoint does not fit the game.
    pub fn resume(
        &self,
        game: &dyn Game,
        experiment: &Experiment,
        device: DeviceKind,
        threads: usize,
    ) -> Result<Trainer, RunError> {
        trainer::check(game, experiment)?;
        let (mut learner, state) = self.last_readable(experiment.algorithm, device)?;
        learner.set_length(experiment);
        let mut trainer = Trainer::with_learner(game, experiment, learner, threads)?;
        trainer.report_panics_to(&self.path);
        for (collector, saved) in trainer.collectors.iter_mut().zip(&state.arenas) {
            restore_arenas(collector, saved).map_err(TrainError::from)?;
        }
        trainer.progress = state.progress;
        trainer.seen = read_sealed::<RunInfo>(&self.path.join("run.json"))?.0.seen;
        checkpoint::set_aside_after(&self.path, trainer.progress.steps)?;
        self.metrics_log().rewind(trainer.progress.steps, trainer.progress.updates)?;
        Ok(trainer)
    }

    fn last_readable(
        &self,
        algorithm: Algorithm,
        device: DeviceKind,
    ) -> Result<(TrainedLearner, TrainState), RunError> {
        let mut bad = Vec::new();
        for checkpoint in checkpoint::list(&self.path)?.iter().rev() {
            match read_checkpoint(checkpoint, algorithm, device) {
                Ok(read) => {
                    if let Some(words) = passed_over(&bad, checkpoint.summary.step) {
                        tracing::warn!("{words}");
                    }
                    return Ok(read);
                }
                Err(error) => bad.push((checkpoint.summary.step, error)),
            }
        }
        let none = RunError::NoCheckpoint { path: self.path.clone(), steps: Vec::new() };
        Err(bad.into_iter().next().map_or(none, |(_, error)| error))
    }
}

fn read_checkpoint(
    checkpoint: &Checkpoint,
    algorithm: Algorithm,
    device: DeviceKind,
) -> Result<(TrainedLearner, TrainState), RunError> {
    let learner = TrainedLearner::load(algorithm, &checkpoint.learner_file(), device)?;
    Ok((learner, read_sealed(&checkpoint.arenas_file())?.0))
}

/// Adds the remedy to the error of a damaged file.
fn with_remedy(error: SealedFileError, damage: fn(PathBuf, &str) -> RunError) -> RunError {
    match error {
        SealedFileError::Damaged { path, message } => damage(path, &message),
        other => other.into(),
    }
}

/// Describes the latest checkpoints of a run that cannot be read, by step and error, before the first readable one at
/// `step`. `None` if the last checkpoint is readable.
fn passed_over(bad: &[(u64, RunError)], step: u64) -> Option<String> {
    let (latest, why) = bad.first()?;
    if bad.len() == 1 {
        return Some(format!(
            "the checkpoint of step {latest} cannot be read ({why}); going on from step {step} instead"
        ));
    }
    let steps: Vec<String> = bad.iter().map(|(step, _)| step.to_string()).collect();
    Some(format!(
        "the checkpoints of the steps {} cannot be read (the first: {why}); going on from step {step} instead",
        steps.join(", ")
    ))
}

/// Removes the files that a process left when it was killed while it wrote into a run: temporary files and partial
/// checkpoints. Nothing depends on success, so a failure is only a warning.
fn tidy(lock: &RunLock) {
    remove_temporaries(lock.folder());
    if let Err(error) = checkpoint::remove_halves(lock.folder()) {
        tracing::warn!("{error}");
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn one_sentence_says_it_of_all() {
        let bad = |step: u64| (step, damaged(Path::new("a"), &"torn").into());
        assert_eq!(passed_over(&[], 8), None);
        let words = passed_over(&[bad(16)], 8).expect("one");
        assert!(words.starts_with("the checkpoint of step 16 cannot be read (a: "), "{words}");
        assert!(words.ends_with("going on from step 8 instead"), "{words}");
        let words = passed_over(&[bad(24), bad(16)], 8).expect("two");
        assert!(words.starts_with("the checkpoints of the steps 24, 16 cannot be read (the first: a: "), "{words}");
    }

    #[test]
    fn what_was_left_is_gone_and_all_else_stays() {
        let run = tempfile::tempdir().expect("a folder");
        let file = |name: &str| {
            let path = run.path().join(name);
            fs::create_dir_all(path.parent().expect("in the run")).expect("writable");
            fs::write(&path, "half").expect("writable");
            path
        };
        let left = ["metrics.jsonl.tmp12", "checkpoints/unfinished/learner.safetensors.tmp12", "checkpoints/removed/a"];
        let kept =
            ["metrics.jsonl", "notes.tmp", "checkpoints/step-8/a", "checkpoints/damaged-step-16/a", "mine/a.tmp12"];
        let (left, kept) = (left.map(file), kept.map(file));
        tidy(&RunLock::take(run.path()).expect("free"));
        assert!(left.iter().all(|path| !path.exists()) && kept.iter().all(|path| path.exists()));
        assert!(
            !run.path().join("checkpoints/unfinished").exists() && !run.path().join("checkpoints/removed").exists()
        );
        tidy(&RunLock::take(run.path()).expect("free"));
    }
}

//! The folder of a run: configuration, metrics, checkpoint.
//!
//! ```text
//! runs/<id>/experiment.ron     the experiment with all defaults filled in
//! runs/<id>/run.json           algorithm, seed, version
//! runs/<id>/metrics.jsonl      one line per update; the same bytes for the same seed
//! runs/<id>/timing.jsonl       seconds and steps per second of each update
//! runs/<id>/tensorboard/       both, as an event file for TensorBoard
//! runs/<id>/checkpoints/       the latest and the best, see [`checkpoint`](super::checkpoint)
//! runs/<id>/run.lock           locked while somebody trains, see [`RunLock`]
//! ```

use std::path::{Path, PathBuf};

use playbot_learner::{DeviceKind, SeenLevels, disk, seal_text};
use serde::{Deserialize, Serialize};

use super::{
    arena_state::{ArenaState, restore_arenas, save_arenas},
    checkpoint::{self, Checkpoint, CheckpointChoice},
    config::{Algorithm, Experiment},
    config_file::read_experiment,
    learner::TrainedLearner,
    metrics_log::MetricsLog,
    missing_run::check_is_run,
    passed_over::passed_over,
    progress::Progress,
    replaced_run::ReplacedRun,
    run_error::{FOLDER, unreadable},
    run_lock::RunLock,
    sealed_file::{check_text_seal, read_sealed, warn_of_no_seal, write_sealed},
    tidy::tidy,
    train_error::TrainError,
    trainer::{self, Trainer},
    update_report::UpdateReport,
};
use crate::game::Game;

pub(super) use super::run_error::{damaged, io_error};
pub use super::{
    replaced_run::{check_new, check_replaceable, end_replacement, is_unstarted},
    run_error::{MEND, RunError},
};

/// What a run trains.
const EXPERIMENT: &str = "experiment.ron";

/// Writes a file under a temporary name, flushes it to the disk and renames it: the old content or the new, never half.
///
/// # Errors
///
/// [`RunError::Io`].
pub fn write_atomically(path: &Path, content: &[u8]) -> Result<(), RunError> {
    playbot_learner::write_atomically(path, content).map_err(io_error("write", path))
}

/// What `run.json` says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunInfo {
    /// The algorithm.
    pub algorithm: Algorithm,
    /// The seed.
    pub seed: u64,
    /// Version of this crate.
    pub version: String,
    /// Revision of playbot's own code, where it is known. Nobody asks which revision the game was at: its rules have a
    /// version.
    pub revision: String,
    /// Version of the game's rules.
    pub game_version: u32,
    /// [Checksum](super::checksum::file_checksum) of the skill model's file, if the algorithm needs one.
    #[serde(default)]
    pub skills: Option<String>,
    /// The levels that it sees, those of its recordings and of its skills' among them; runs of older versions do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seen: Option<SeenLevels>,
    /// What it was started on; the usual one where a run does not say.
    #[serde(default)]
    pub device: DeviceKind,
}

/// The saved state of a training besides the learner.
#[derive(Serialize, Deserialize)]
struct TrainState {
    progress: Progress,
    arenas: Vec<Vec<ArenaState>>,
}

/// An open folder of a run.
pub struct RunDir {
    path: PathBuf,
    /// Held by who writes.
    _lock: Option<RunLock>,
}

/// A run that exists, with what its folder says of it.
pub struct OpenedRun {
    /// The folder.
    pub run: RunDir,
    /// Its experiment, with all defaults filled in.
    pub experiment: Experiment,
    /// What its `run.json` says.
    pub info: RunInfo,
}

impl RunDir {
    /// Makes the folder if it is not there, locks it, and writes what the run is.
    ///
    /// # Errors
    ///
    /// [`RunError::Exists`] for a run unless `force`, which replaces it; what is no run is left alone with
    /// [`RunError::NotARun`], and what is in use with [`RunError::Busy`]. [`RunError::Io`] if it cannot be written.
    pub fn create(path: &Path, experiment: &Experiment, info: &RunInfo, force: bool) -> Result<Self, RunError> {
        check_new(path, force)?;
        disk::create_dir_all(path).map_err(io_error(FOLDER, path))?;
        Self::begin(RunLock::take(path)?, experiment, info)
    }

    /// Writes what the run is into a folder that is locked. A run that lies there is moved aside and removed once the new
    /// one is written; it comes back if that fails.
    ///
    /// # Errors
    ///
    /// [`RunError::NotARun`] for a folder with something else; [`RunError::Io`] if it cannot be written.
    pub fn begin(lock: RunLock, experiment: &Experiment, info: &RunInfo) -> Result<Self, RunError> {
        let path = lock.folder().to_owned();
        check_replaceable(&path)?;
        let run = Self { path: path.clone(), _lock: Some(lock) };
        let aside = ReplacedRun::put_aside(&path)?;
        let written = run.write_experiment(experiment).and_then(|()| write_sealed(&path.join("run.json"), info));
        match written {
            Ok(()) => aside.remove(),
            Err(error) => {
                aside.put_back();
                return Err(error);
            }
        }
        Ok(run)
    }

    /// Opens the folder of a run that exists, to read.
    ///
    /// # Errors
    ///
    /// [`RunError::NoRun`] if there is none; another [`RunError`] if its files are damaged.
    pub fn open(path: &Path) -> Result<OpenedRun, RunError> {
        check_is_run(path)?;
        check_text_seal(&path.join(EXPERIMENT))?;
        let experiment = read_experiment(&path.join(EXPERIMENT))?;
        let info_path = path.join("run.json");
        let (info, had_seal) = read_sealed(&info_path).map_err(|error| match error {
            RunError::Damaged { path, message } => unreadable(&path, &message),
            other => other,
        })?;
        if !had_seal {
            warn_of_no_seal(&info_path);
        }
        Ok(OpenedRun { run: Self { path: path.into(), _lock: None }, experiment, info })
    }

    /// [`open`](Self::open), to go on with it.
    ///
    /// # Errors
    ///
    /// As for [`open`](Self::open), and [`RunError::Busy`].
    pub fn open_to_write(path: &Path) -> Result<OpenedRun, RunError> {
        end_replacement(path)?;
        // A folder that is no run gets no lock file.
        Self::open(path)?;
        Self::open_with(RunLock::take(path)?)
    }

    /// [`open`](Self::open) in a folder that is locked, to go on with it. What killed processes left in it is removed.
    ///
    /// # Errors
    ///
    /// As for [`open`](Self::open).
    pub fn open_with(lock: RunLock) -> Result<OpenedRun, RunError> {
        let OpenedRun { run, experiment, info } = Self::open(lock.folder())?;
        tidy(&lock);
        Ok(OpenedRun { run: Self { _lock: Some(lock), ..run }, experiment, info })
    }

    /// Writes the experiment anew, after its steps were raised.
    ///
    /// # Errors
    ///
    /// [`RunError::Io`].
    pub fn write_experiment(&self, experiment: &Experiment) -> Result<(), RunError> {
        let text = experiment.to_ron().map_err(|error| damaged(&self.path, &error))?;
        write_atomically(&self.path.join(EXPERIMENT), seal_text(&text).as_bytes())
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A checkpoint of the run: the policy, its prior and all that training needs.
    ///
    /// # Errors
    ///
    /// [`RunError::NoCheckpoint`].
    pub fn checkpoint(&self, choice: CheckpointChoice) -> Result<Checkpoint, RunError> {
        checkpoint::choose(&self.path, choice)
    }

    /// Its metrics.
    pub fn metrics_log(&self) -> MetricsLog {
        MetricsLog::new(&self.path)
    }

    /// Appends an update to the metrics.
    ///
    /// # Errors
    ///
    /// [`RunError::Io`].
    pub fn log(&self, report: &UpdateReport, steps_per_update: u64) -> Result<(), RunError> {
        self.metrics_log().append(report, steps_per_update)
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
            write_sealed(&fresh.arenas_file(), &state)
        })
    }

    /// Brings a training back from its last checkpoint, and drops metrics that were logged after it. A checkpoint that
    /// cannot be read, say after a fault of the disk, is passed over with a warning for the one before it.
    ///
    /// # Errors
    ///
    /// [`RunError`] if there is no checkpoint, none can be read, or it does not fit the game.
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

//! The folder of a run: configuration, metrics, checkpoint.
//!
//! ```text
//! runs/<id>/experiment.ron     the experiment with all defaults filled in
//! runs/<id>/run.json           algorithm, seed, version
//! runs/<id>/metrics.jsonl      one line per update; the same bytes for the same seed
//! runs/<id>/timing.jsonl       seconds and steps per second of each update
//! runs/<id>/tensorboard/       both, as an event file for TensorBoard
//! runs/<id>/checkpoint/        learner.safetensors, arenas.json
//! ```

use std::{
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
};

use playbot_learner::{DeviceKind, FileError, PpoLearner};
use serde::{Deserialize, Serialize};
use serde_json::json;
use thiserror::Error;

use super::{
    arena_state::{ArenaState, restore_arenas, save_arenas},
    config::{Algorithm, Experiment},
    config_file::{ConfigError, read_experiment},
    metrics_log::MetricsLog,
    trainer::{self, Progress, TrainError, Trainer, UpdateReport},
};
use crate::game::Game;

const CHECKPOINT: &str = "checkpoint";
const LEARNER: &str = "learner.safetensors";
const ARENAS: &str = "arenas.json";

/// A run's folder cannot be used.
#[derive(Debug, Error)]
pub enum RunError {
    /// The folder exists already.
    #[error("{} exists already: choose another --run, go on with --resume, or overwrite with --force", .0.display())]
    Exists(PathBuf),
    /// The folder to overwrite is something else.
    #[error("{} is not the folder of a run, so it is left alone: choose another --run", .0.display())]
    NotARun(PathBuf),
    /// There is nothing to go on with.
    #[error("{} has no checkpoint to resume from", .0.display())]
    NothingToResume(PathBuf),
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
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
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The saved training does not fit the game.
    #[error(transparent)]
    Train(#[from] TrainError),
}

pub(super) fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> RunError {
    move |source| RunError::Io { action, path: path.into(), source }
}

/// Writes a file under a temporary name, flushes it to the disk and renames it: the old content or the new, never half.
///
/// # Errors
///
/// [`RunError::Io`].
pub fn write_atomically(path: &Path, content: &[u8]) -> Result<(), RunError> {
    let temporary = path.with_extension("tmp");
    let write = || -> io::Result<()> {
        let mut file = File::create(&temporary)?;
        file.write_all(content)?;
        file.sync_all()
    };
    write().map_err(io_error("write", &temporary))?;
    fs::rename(&temporary, path).map_err(io_error("write", path))
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
    /// Revision of the code, where it is known.
    pub revision: String,
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
}

impl RunDir {
    /// Makes the folder and writes what the run is.
    ///
    /// # Errors
    ///
    /// [`RunError::Exists`] unless `force`, which empties the folder; [`RunError::Io`] if it cannot be written.
    pub fn create(path: &Path, experiment: &Experiment, info: &RunInfo, force: bool) -> Result<Self, RunError> {
        if path.exists() {
            if !force {
                return Err(RunError::Exists(path.into()));
            }
            if !is_run(path) {
                return Err(RunError::NotARun(path.into()));
            }
            fs::remove_dir_all(path).map_err(io_error("empty", path))?;
        }
        fs::create_dir_all(path).map_err(io_error("create", path))?;
        let run = Self { path: path.into() };
        run.write_experiment(experiment)?;
        write_atomically(&path.join("run.json"), json!(info).to_string().as_bytes())?;
        Ok(run)
    }

    /// Opens the folder of a run that exists.
    ///
    /// # Errors
    ///
    /// [`RunError`] if its files are missing or damaged.
    pub fn open(path: &Path) -> Result<(Self, Experiment, RunInfo), RunError> {
        let experiment = read_experiment(&path.join("experiment.ron"))?;
        let info_path = path.join("run.json");
        let text = fs::read_to_string(&info_path).map_err(io_error("read", &info_path))?;
        let info = serde_json::from_str(&text).map_err(|error| damaged(&info_path, &error))?;
        Ok((Self { path: path.into() }, experiment, info))
    }

    /// Writes the experiment anew, after its steps were raised.
    ///
    /// # Errors
    ///
    /// [`RunError::Io`].
    pub fn write_experiment(&self, experiment: &Experiment) -> Result<(), RunError> {
        let text = ron::ser::to_string_pretty(experiment, ron::ser::PrettyConfig::default())
            .map_err(|error| damaged(&self.path, &error))?;
        write_atomically(&self.path.join("experiment.ron"), text.as_bytes())
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The learner's file of the last checkpoint: the policy, its prior and all that training needs.
    pub fn learner_file(&self) -> PathBuf {
        self.checkpoint().join(LEARNER)
    }

    /// The last whole checkpoint. `save` renames twice; between the two it is the old one.
    fn checkpoint(&self) -> PathBuf {
        let current = self.path.join(CHECKPOINT);
        if current.exists() { current } else { self.path.join("checkpoint.old") }
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

    /// Saves learner and arenas. The previous checkpoint stays until the new one is whole.
    ///
    /// # Errors
    ///
    /// [`RunError`]; the previous checkpoint is still there.
    pub fn save(&self, trainer: &mut Trainer) -> Result<(), RunError> {
        let (fresh, old) = (self.path.join("checkpoint.new"), self.path.join("checkpoint.old"));
        let current = self.path.join(CHECKPOINT);
        remove_if_there(&fresh)?;
        fs::create_dir_all(&fresh).map_err(io_error("create", &fresh))?;
        trainer.learner.save(&fresh.join(LEARNER))?;
        let state = TrainState {
            progress: trainer.progress.clone(),
            arenas: trainer.collectors.iter_mut().map(save_arenas).collect(),
        };
        write_atomically(&fresh.join(ARENAS), json!(state).to_string().as_bytes())?;
        remove_if_there(&old)?;
        if current.exists() {
            fs::rename(&current, &old).map_err(io_error("move", &current))?;
        }
        fs::rename(&fresh, &current).map_err(io_error("move", &fresh))?;
        remove_if_there(&old)
    }

    /// Brings a training back from its last checkpoint, and drops metrics that were logged after it.
    ///
    /// # Errors
    ///
    /// [`RunError`] if there is no checkpoint, it is damaged, or it does not fit the game.
    pub fn resume(
        &self,
        game: &dyn Game,
        experiment: &Experiment,
        info: &RunInfo,
        device: DeviceKind,
        threads: usize,
    ) -> Result<Trainer, RunError> {
        trainer::check(game, experiment)?;
        let folder = self.checkpoint();
        if !folder.exists() {
            return Err(RunError::NothingToResume(self.path.clone()));
        }
        let learner = PpoLearner::load(&folder.join(LEARNER), device)?;
        let arenas = folder.join(ARENAS);
        let text = fs::read_to_string(&arenas).map_err(io_error("read", &arenas))?;
        let state: TrainState = serde_json::from_str(&text).map_err(|error| damaged(&arenas, &error))?;
        let mut trainer = Trainer::with_learner(game, experiment, info.algorithm, learner, threads)?;
        for (collector, saved) in trainer.collectors.iter_mut().zip(&state.arenas) {
            restore_arenas(collector, saved).map_err(TrainError::from)?;
        }
        trainer.progress = state.progress;
        self.metrics_log().rewind(trainer.progress.steps)?;
        Ok(trainer)
    }
}

/// Whether a folder is empty or was made by [`RunDir::create`].
fn is_run(path: &Path) -> bool {
    let is_empty = fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none());
    is_empty || (path.join("run.json").is_file() && path.join("experiment.ron").is_file())
}

fn damaged(path: &Path, error: &impl ToString) -> RunError {
    RunError::Damaged { path: path.into(), message: error.to_string() }
}

fn remove_if_there(folder: &Path) -> Result<(), RunError> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(io_error("remove", folder)(error)),
        _ => Ok(()),
    }
}

//! Errors of training.

use crate::{
    cluster::ClusterError,
    collect::RestoreError,
    experiment::{Algorithm, ExperimentError, error::ConfigError},
};
use bevy_playbot::{
    fault::Fault,
    vision::{ObservationConfig, UnknownObservation, VisionError},
};
use playbot_harness::{
    rivals::matches::MatchError,
    sealed_file::{SealedFileError, damaged},
    split::LevelSplit,
};
use playbot_learner::{FileError, HasExitCode, LearnError};
use std::{io, path::PathBuf};
use thiserror::Error;

/// Returns what to do with an algorithm that the verb `train` does not train.
fn instead_of_training(algorithm: Algorithm) -> &'static str {
    match algorithm {
        Algorithm::Imitation => "imitate with `playbot imitate`",
        _ => "measure its skill model with `playbot eval --skills FILE`",
    }
}

/// Failure of training.
#[derive(Debug, Error)]
pub enum TrainError {
    /// The experiment is invalid.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    /// The game does not support the observations.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The algorithm needs a skill model.
    #[error(
        "{0} needs a skill model: learn one with `playbot learn-skills --out skills.safetensors`, and pass it on with \
         `--skills skills.safetensors`"
    )]
    NoSkills(Algorithm),
    /// The algorithm trains on recordings too.
    #[error("{0} trains on recordings with rewards, and there are none: name them in `demos`")]
    NoDemos(Algorithm),
    /// The algorithm does not learn from play.
    #[error("{0} is not trained: {advice}", advice = instead_of_training(*.0))]
    NotTrained(Algorithm),
    /// The skill model was learned for another game.
    #[error(
        "the skill model was learned for {} and {model_actions}, but `{game}` has {} and {game_actions}: learn one \
         from demonstrations of this game", .model_obs.describe(), .game_obs.describe()
    )]
    ForeignSkills {
        /// The game.
        game: String,
        /// Observation of the model.
        model_obs: playbot_learner::ObsKind,
        /// Actions of the model.
        model_actions: Box<playbot_learner::ActionSpace>,
        /// Observation of the game.
        game_obs: playbot_learner::ObsKind,
        /// Actions of the game.
        game_actions: Box<playbot_learner::ActionSpace>,
    },
    /// The skill model reads sets of things that the game's observation does not have.
    #[error(
        "the skill model reads sets of things where `{game}` has none, or others: learn one from demonstrations of this game"
    )]
    OtherSets {
        /// The game.
        game: String,
    },
    /// The skill model was learned from other pictures, or from vectors.
    #[error(
        "the skill model was learned from {model}, but `observation` and `image` of the experiment say {experiment}: \
         learn skills with this experiment, `playbot learn-skills`, or change it to what the model has seen"
    )]
    SkillObservation {
        /// Observations of the model.
        model: ObservationConfig,
        /// Observations of the experiment.
        experiment: ObservationConfig,
    },
    /// The skill model has seen held-out levels.
    #[error(
        "the skill model was learned from demonstrations of {seen}, and the held-out levels {test} of `test` have some of \
         these, so a measurement would not show generalisation: learn skills from recordings of other levels, or hold out \
         others"
    )]
    SeenSkills {
        /// Levels in its demonstrations.
        seen: String,
        /// The held-out levels.
        test: LevelSplit,
    },
    /// The skill model's metadata names pictures that this version does not know.
    #[error(transparent)]
    UnknownObservation(#[from] UnknownObservation),
    /// The system does not start a thread for each World.
    #[error(
        "{worlds} Worlds play on a thread each, and the system does not start so many: {source}; lower `worlds`, or raise what \
         limits threads or address space (`ulimit -u`, `ulimit -v`, or that of the container)"
    )]
    Threads {
        /// Number of Worlds.
        worlds: usize,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The learner cannot go on, for instance because a loss is not a number.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// A checkpoint could not be restored.
    #[error(transparent)]
    Restore(#[from] RestoreError),
    /// The workers of a cluster do not play.
    #[error(transparent)]
    Cluster(#[from] ClusterError),
    /// Matches with rivals cannot be played.
    #[error("the rating of rivals failed: {0}")]
    Rivals(Box<MatchError>),
}

impl HasExitCode for TrainError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Fault(_) | Self::Restore(RestoreError::Fault(_)) => 2,
            Self::Learn(error) => error.exit_code(),
            Self::Rivals(error) => error.exit_code(),
            Self::Cluster(error) => error.exit_code(),
            _ => 3,
        }
    }
}

// Errors of the folder of a run.

/// Failure to use the folder of a run.
#[derive(Debug, Error)]
pub enum RunError {
    /// The folder exists already.
    #[error("{} exists already: choose another --run, go on with --resume, or overwrite with --force", .0.display())]
    Exists(PathBuf),
    /// The folder is not a run.
    #[error("no run at {}: {advice}", path.display())]
    NoRun {
        /// Path of the folder.
        path: PathBuf,
        /// The present content of the folder, and the remedy.
        advice: String,
    },
    /// The folder to overwrite is not a run.
    #[error("{} is not the folder of a run, so it is left alone: choose another --run", .0.display())]
    NotARun(PathBuf),
    /// Another process trains in the folder.
    #[error(
        "{} is in use by another process that trains there: wait for it or stop it, or choose another folder", .0.display()
    )]
    Busy(PathBuf),
    /// The checkpoint is missing.
    #[error("{} has {}", path.display(), list_steps(steps))]
    NoCheckpoint {
        /// The folder of the run.
        path: PathBuf,
        /// Environment steps of the existing checkpoints.
        steps: Vec<u64>,
    },
    /// The folder of a new run cannot be made; nothing is lost.
    #[error(
        "cannot create the folder {}: {source}; make room or grant write access there, or name another folder",
        path.display()
    )]
    NoFolder {
        /// The folder.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// A file of the run cannot be read or written, or is damaged.
    #[error(transparent)]
    File(#[from] SealedFileError),
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

impl HasExitCode for RunError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::NoFolder { .. } => 2,
            Self::File(error) => error.exit_code(),
            Self::Learner(error) => error.exit_code(),
            Self::Train(error) => error.exit_code(),
            _ => 3,
        }
    }
}

/// Remedy for a run whose description is damaged.
pub const MEND: &str = "bring it back from a copy, or train the run anew with --force";

/// Converts an error of a run's saved experiment to text.
fn of_run(error: &ConfigError) -> String {
    format!("{error}; the file is part of a run: {MEND}")
}

fn list_steps(steps: &[u64]) -> String {
    if steps.is_empty() {
        return "no checkpoint: wait until training has saved one, restore the checkpoints from a copy, or train again with \
                --force"
            .to_owned();
    }
    let steps: Vec<_> = steps.iter().map(u64::to_string).collect();
    format!("no such checkpoint; the run has those of the steps {}", steps.join(", "))
}

/// Makes the error of a damaged file that a run needs.
pub(crate) fn unreadable(path: PathBuf, message: &str) -> RunError {
    let known = message.strip_prefix("the file is damaged: ").unwrap_or(message);
    damaged(&path, &format!("the file is damaged ({known}): {MEND}")).into()
}

/// Makes the error of a run's experiment that was changed on disk.
pub(crate) fn edited(path: PathBuf, message: &str) -> RunError {
    let message = format!(
        "{message}; the file is part of a run: {MEND}. If you have edited it, write the change as --set for a new run \
         instead"
    );
    damaged(&path, &message).into()
}

//! Errors of training.

use bevy_playbot::{
    fault::Fault,
    vision::{ObservationConfig, UnknownObservation, VisionError},
};
use playbot_learner::{HasExitCode, LearnError};
use thiserror::Error;

use crate::split::LevelSplit;

use super::{
    arena_state::RestoreError,
    config::{Algorithm, ExperimentError},
};

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
    #[error("{0} is not trained: measure its skill model with `playbot eval --skills FILE`")]
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
        model_actions: playbot_learner::ActionSpace,
        /// Observation of the game.
        game_obs: playbot_learner::ObsKind,
        /// Actions of the game.
        game_actions: playbot_learner::ActionSpace,
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
}

impl HasExitCode for TrainError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Fault(_) | Self::Restore(RestoreError::Fault(_)) => 2,
            Self::Learn(error) => error.exit_code(),
            _ => 3,
        }
    }
}

//! Errors of explorations.

use bevy_playbot::{
    demo::{file::DemoFileError, replay::Divergence},
    fault::Fault,
    vision::VisionError,
};
use playbot_learner::HasExitCode;
use thiserror::Error;

use crate::mode::ModeError;

/// The reason why a level cannot be explored.
#[derive(Debug, Error)]
pub enum ExploreError {
    /// The plan is invalid; the text says what to do.
    #[error("{0}")]
    Plan(String),
    /// The game has no such level.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// The pictures that the explorer's policy reads cannot be drawn.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The game does not repeat an episode from the same actions.
    #[error(
        "the path back to a cell does not replay: {divergence}. Explorers return by the same actions, but \
         `{game}` does not repeat them: `playbot doctor {game} --mode {mode} --level {}` names what differs", divergence.level
    )]
    Diverged {
        /// Name of the game.
        game: &'static str,
        /// The mode.
        mode: String,
        /// The first difference from the known path.
        divergence: Divergence,
    },
    /// A path could not be recorded.
    #[error(transparent)]
    Demo(#[from] DemoFileError),
}

impl HasExitCode for ExploreError {
    fn exit_code(&self) -> u8 {
        match self {
            // The game is at fault, and the message says what to do.
            Self::Fault(_) | Self::Diverged { .. } => 2,
            Self::Demo(error) => error.exit_code(),
            Self::Plan(_) | Self::Mode(_) | Self::Vision(_) => 3,
        }
    }
}

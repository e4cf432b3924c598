//! What can keep a level from being explored.

use bevy_playbot::{
    demo::{file::DemoFileError, replay::Divergence},
    fault::Fault,
    vision::VisionError,
};
use thiserror::Error;

use crate::mode::ModeError;

/// A level cannot be explored.
#[derive(Debug, Error)]
pub enum ExploreError {
    /// The plan cannot be carried out, in words that say what to do.
    #[error("{0}")]
    Plan(String),
    /// The game has no such level.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// The pictures that the explorer's policy reads cannot be made.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The game does not play the same when it is given the same actions.
    #[error(
        "the way back to a cell does not replay: {divergence}. Explorers return by the same actions, and `{game}` does not \
         play the same by them: `playbot doctor {game} --mode {mode} --seed {}` names what differs", divergence.level
    )]
    Diverged {
        /// Name of the game.
        game: &'static str,
        /// The mode.
        mode: String,
        /// Where the way stops being the known one.
        divergence: Divergence,
    },
    /// A way could not be recorded.
    #[error(transparent)]
    Demo(#[from] DemoFileError),
}

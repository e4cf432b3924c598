//! Errors of taking over.

use std::path::PathBuf;

use playbot_learner::FileError;
use thiserror::Error;

use super::request::RequestError;
use crate::demo::file::DemoFileError;

/// The reason why a takeover failed.
#[derive(Debug, Error)]
pub enum TakeoverError {
    /// The request cannot be understood.
    #[error("PLAYBOT: {0}")]
    Request(#[from] RequestError),
    /// The recording cannot be read, written or continued, or belongs to another game.
    #[error(transparent)]
    Demo(#[from] DemoFileError),
    /// The policy cannot be read.
    #[error(transparent)]
    Policy(#[from] FileError),
    /// The policy was made for another game, other actions or another observation.
    #[error("{}: {why}", path.display())]
    Misfit {
        /// Path of the policy.
        path: PathBuf,
        /// The difference.
        why: String,
    },
    /// The game records by itself.
    #[error("this game records already; it cannot record into {} as well", path.display())]
    Recording {
        /// Path of the file that was asked for.
        path: PathBuf,
    },
    /// There is no episode to play.
    #[error("{}: the recording holds no episode that could be played", path.display())]
    Empty {
        /// Path of the recording.
        path: PathBuf,
    },
}

//! Errors of a test of levels.

use std::path::PathBuf;

use bevy_playbot::{
    policy_file::PolicyMisfit,
    unknown_name::UnknownName,
    vision::{UnknownObservation, VisionError},
};
use playbot_learner::FileError;
use thiserror::Error;

use crate::{
    detectors::DetectorError, findings::FindingError, mode::ModeError, sealed_file::SealedFileError, split::SplitError,
    verdict::TestError,
};

/// The reason why levels cannot be tested.
#[derive(Debug, Error)]
pub enum LevelTestError {
    /// The text names no levels.
    #[error(transparent)]
    Levels(#[from] SplitError),
    /// The game has no such mode, or a level file does not fit the game.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// The game has no such bot.
    #[error(transparent)]
    Bot(#[from] UnknownName),
    /// The game has no bot at all.
    #[error("`{0}` has no bot: name a policy with `LevelTest::policy`, or a player with `LevelTest::player`")]
    NoBot(&'static str),
    /// The policy cannot be read.
    #[error(transparent)]
    Policy(#[from] FileError),
    /// The policy's file cannot be read again.
    #[error(transparent)]
    Checksum(#[from] SealedFileError),
    /// The policy was made for another game, or another state of it.
    #[error("{}: {misfit}", path.display())]
    Misfit {
        /// Its file.
        path: PathBuf,
        /// The difference between policy and game.
        misfit: Box<PolicyMisfit>,
    },
    /// The policy does not name its observation.
    #[error(transparent)]
    Observation(#[from] UnknownObservation),
    /// The game cannot draw the picture that the policy needs.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// There is no such detector or setting.
    #[error(transparent)]
    Detector(#[from] DetectorError),
    /// The game cannot be played, or the plan is invalid.
    #[error(transparent)]
    Test(#[from] TestError),
    /// A finding cannot be written.
    #[error(transparent)]
    Finding(#[from] FindingError),
}

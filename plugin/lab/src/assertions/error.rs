//! Why levels cannot be tested.

use std::path::PathBuf;

use bevy_playbot::{
    policy_file::PolicyMisfit,
    unknown_name::UnknownName,
    vision::{UnknownObservation, VisionError},
};
use playbot_learner::FileError;
use thiserror::Error;

use crate::{
    detectors::DetectorError, findings::FindingError, mode::ModeError, split::SplitError, train::run_dir::RunError,
    verdict::TestError,
};

/// Levels cannot be tested at all.
#[derive(Debug, Error)]
pub enum LevelTestError {
    /// The text names no levels.
    #[error(transparent)]
    Levels(#[from] SplitError),
    /// The game has no such mode, or a level file is none of its levels.
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
    Checksum(#[from] RunError),
    /// The policy was made for another game, or another state of it.
    #[error("{}: {misfit}", path.display())]
    Misfit {
        /// Its file.
        path: PathBuf,
        /// What does not fit.
        misfit: Box<PolicyMisfit>,
    },
    /// The policy does not say what it sees.
    #[error(transparent)]
    Observation(#[from] UnknownObservation),
    /// The game cannot be seen as the policy needs it.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// There is no such detector or setting.
    #[error(transparent)]
    Detector(#[from] DetectorError),
    /// The game cannot be played, or the plan makes no sense.
    #[error(transparent)]
    Test(#[from] TestError),
    /// A finding cannot be written.
    #[error(transparent)]
    Finding(#[from] FindingError),
}

//! The testers of an assertion.

use crate::{
    detectors::DetectorError,
    findings::FindingError,
    verdict::{TestError, Tester, TesterRecord},
};
use bevy_playbot::{
    engine::policy_observation,
    policy::ActionDraw,
    policy_file::{PolicyMisfit, check_policy},
    unknown_name::UnknownName,
    vision::{ObservationConfig, UnknownObservation, VisionError},
};
use playbot_harness::{
    eval::Player,
    game::Game,
    mode::ModeError,
    sealed_file::{SealedFileError, file_checksum},
    sensors::GameSensors,
    split::SplitError,
};
use playbot_learner::{DeviceKind, FileError, PolicyFile};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A tester by its name.
#[derive(Clone)]
#[allow(clippy::large_enum_variant, reason = "a few per test")]
pub(super) enum Named {
    /// A bot of the game.
    Bot(String),
    /// A policy file.
    Policy { path: PathBuf, draw: ActionDraw },
    /// A player that the command line does not know.
    Player { name: String, player: Player },
}

impl Named {
    /// Prepares the tester for the game.
    pub fn tester(&self, game: &dyn Game) -> Result<Tester, LevelTestError> {
        match self {
            Self::Bot(name) => Ok(of_player(name, Player::bot(game, name)?)),
            Self::Policy { path, draw } => policy(game, path, *draw),
            Self::Player { name, player } => Ok(of_player(name, player.clone())),
        }
    }

    /// Returns the tester's name, if the command line does not know it.
    pub fn own_name(&self) -> Option<&str> {
        match self {
            Self::Player { name, .. } => Some(name),
            Self::Bot(_) | Self::Policy { .. } => None,
        }
    }
}

/// Returns a tester with vectors as observations.
pub(super) fn of_player(name: &str, player: Player) -> Tester {
    Tester { record: TesterRecord::bot(name), player, observation_config: ObservationConfig::default() }
}

fn policy(game: &dyn Game, path: &Path, draw: ActionDraw) -> Result<Tester, LevelTestError> {
    let file = PolicyFile::load(path, DeviceKind::default())?;
    check_policy(&game.metadata(), &file)
        .map_err(|misfit| LevelTestError::Misfit { path: path.into(), misfit: Box::new(misfit) })?;
    let observation_config = policy_observation(&file)?;
    observation_config.check(game)?;
    let greedy = matches!(draw, ActionDraw::Greedy);
    Ok(Tester {
        record: TesterRecord { greedy, ..TesterRecord::policy(None, path, file_checksum(path)?) },
        player: Player::of_file(&file, draw),
        observation_config,
    })
}

/// The reason why levels cannot be tested.
#[derive(Debug, Error)]
pub enum LevelTestError {
    /// No levels were named.
    #[error("no levels are named: write `.levels(\"MODE:first..last\")`, such as `.levels(\"default:0..9\")`")]
    NoLevels,
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

//! The testers of an assertion.

use std::path::{Path, PathBuf};

use bevy_playbot::{
    policy::ActionDraw,
    policy_file::{check_policy, policy_observation},
    unknown_name::UnknownName,
    vision::ObservationConfig,
};
use playbot_learner::{DeviceKind, PolicyFile};

use super::error::LevelTestError;
use crate::{
    eval::{Player, blind_bots},
    game::Game,
    sealed_file::file_checksum,
    sensors::GameSensors,
    verdict::{Tester, TesterRecord},
};

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
            Self::Bot(name) => Ok(of_player(name, bot(game, name)?)),
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

/// Returns the names of all bots of a game, the demonstrator first.
pub(super) fn bot_names(game: &dyn Game) -> Vec<&'static str> {
    let blind = blind_bots(game).into_iter().map(|(name, _)| name);
    game.tools().bots.demonstrator().into_iter().chain(blind).collect()
}

fn bot(game: &dyn Game, name: &str) -> Result<Player, UnknownName> {
    if game.tools().bots.demonstrator() == Some(name) {
        return Ok(Player::Demonstrator);
    }
    let found = blind_bots(game).into_iter().find(|(bot, _)| *bot == name);
    match found {
        Some((_, bot)) => Ok(Player::Blind(bot)),
        None => Err(UnknownName::new("bot", name, &bot_names(game))),
    }
}

fn of_player(name: &str, player: Player) -> Tester {
    Tester { record: TesterRecord::bot(name), player, observation_config: ObservationConfig::default() }
}

fn policy(game: &dyn Game, path: &Path, draw: ActionDraw) -> Result<Tester, LevelTestError> {
    let file = PolicyFile::load(path, DeviceKind::default())?;
    check_policy(&game.card(), &file)
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

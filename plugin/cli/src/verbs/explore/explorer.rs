//! The explorers that a user can ask for: random actions, skills of a model, or a policy.

use crate::{
    arguments::{
        default_experiment_of,
        experiment::ExperimentArgs,
        player::{LoadedPlayer, check_skills},
    },
    error::CliError,
};
use bevy_playbot::{policy::ActionDraw, skill_prior::SkillPrior, vision::ObservationConfig};
use playbot_harness::{eval::Player, game::Game, games::Games};
use playbot_learner::{DeviceKind, ScoreConfig, SkillDraw, SkillModel, SkillSource};
use playbot_test::explore::Explorer;
use std::path::Path;

/// An explorer and its observation.
pub struct ExplorerSetup {
    pub explorer: Explorer,
    pub observation_config: ObservationConfig,
}

impl ExplorerSetup {
    /// Returns an explorer with random actions.
    pub fn none() -> Self {
        Self { explorer: Explorer::Random, observation_config: ObservationConfig::default() }
    }

    /// Skills of a model, drawn from its prior, with the skill interval of the game's experiment.
    ///
    /// # Errors
    ///
    /// The model cannot be read, or was learned for another game.
    pub fn skills(path: &Path, game: &dyn Game, games: &Games, device: DeviceKind) -> Result<Self, CliError> {
        let model = SkillModel::load(path, device)?;
        // The game is named, so that errors do not ask for an experiment.
        let named = ExperimentArgs::of_game(game.name());
        let observation_config = check_skills(path, &model, game, &named, games)?;
        let skill_interval = default_experiment_of(game)
            .map_or_else(ScoreConfig::default, |default| default.experiment.score)
            .skill_interval;
        let source =
            SkillSource { prior: model.prior(), decoder: model.policy(), skill_interval, draw: SkillDraw::Sample };
        Ok(Self { explorer: Explorer::skills(SkillPrior::from(&source), source.decoder), observation_config })
    }

    /// Returns the policy of a file, whose actions are drawn.
    ///
    /// # Errors
    ///
    /// It cannot be loaded, or was made for another game.
    pub fn policy(path: &Path, game: &dyn Game, device: DeviceKind) -> Result<Self, CliError> {
        let chosen = LoadedPlayer::policy_file(game, path, ActionDraw::Sample, device)?;
        chosen.check_fit(game)?;
        let explorer = match chosen.player {
            Player::Policy { policy, prior, draw } => Explorer::Policy { policy, prior, draw },
            Player::Blind(_) | Player::Demonstrator => Explorer::Random,
        };
        Ok(Self { explorer, observation_config: chosen.observation_config })
    }
}

//! Behaviour cloning: a skill model that plays by itself.

use std::path::Path;

use bevy_playbot::{policy::ActionDraw, skill_prior::SkillPrior, vision::ObservationConfig};
use playbot_lab::{eval::Player, game::Game, games::Games, sensors::GameSensors, train::Experiment};
use playbot_learner::{SkillModel, SkillSource};

use super::{error::CliError, experiment::ExperimentArgs};

/// Checks that a skill model was learned for a game, and returns what it sees. Files of older versions do not name their game.
///
/// # Errors
///
/// What the model reads and how it acts, and which game has that.
pub fn check_skills(
    path: &Path,
    model: &SkillModel,
    game: &dyn Game,
    from: &ExperimentArgs,
    games: &Games,
) -> Result<ObservationConfig, CliError> {
    let observation_config = ObservationConfig::from_card(model.picture(), &model.observation())?;
    let fits = |game: &dyn Game| {
        let can_see = observation_config.check(game).is_ok();
        can_see && (model.observation(), model.action_space()) == (observation_config.obs_kind(game), game.actions())
    };
    if fits(game) {
        return Ok(observation_config);
    }
    let others: Vec<_> = games.iter().filter(|game| fits(*game)).map(|game| game.name()).collect();
    let whose = if others.is_empty() { "no game here".to_owned() } else { others.join(" or ") };
    let advice = match others.first() {
        None => "use the program that has the game they were learned for".to_owned(),
        Some(_) if from.names_game() => "name another one".to_owned(),
        Some(game) => format!("name its experiment with --experiment, or its game, `{game}`, behind the verb"),
    };
    Err(CliError::Usage(format!(
        "{} holds skills for {} and {}, which are those of {whose}, not of `{}`: {advice}",
        path.display(),
        model.observation().describe(),
        model.action_space(),
        game.name()
    )))
}

/// Behaviour cloning: the decoder under the prior, without any reinforcement learning.
pub fn cloning(model: &SkillModel, experiment: &Experiment, draw: ActionDraw) -> Player {
    let skills = cloning_skills(model, experiment);
    Player::Policy { policy: model.policy(), prior: Some(SkillPrior::from(&skills)), draw }
}

/// The skills of behaviour cloning, held and drawn as the experiment says.
pub fn cloning_skills(model: &SkillModel, experiment: &Experiment) -> SkillSource {
    let (horizon, draw) = (experiment.score.horizon, experiment.score.skill_draw);
    SkillSource { prior: model.prior(), decoder: model.policy(), horizon, draw }
}

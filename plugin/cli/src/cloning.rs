//! Behaviour cloning: a skill model that plays by itself.

use std::path::Path;

use bevy_playbot::vision::ObservationConfig;
use playbot_lab::{game::Game, games::Games, sensors::GameSensors};
use playbot_learner::SkillModel;

use super::{error::CliError, experiment::ExperimentArgs};

/// Checks that a skill model was learned for a game, and returns its observation. Files of older versions do not name
/// their game.
///
/// # Errors
///
/// The model's observations or actions do not fit the game. The message names the game that they fit.
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

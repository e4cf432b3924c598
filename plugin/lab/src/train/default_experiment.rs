//! The default experiment.

use crate::{experiment_text::ExperimentText, game::Game, games::Games};

/// Number of training levels, and of test levels after them, for a game without its own experiment.
const LEVELS: u64 = 64;

/// Returns the experiment of a program's first game, see [`experiment_of`].
pub fn default_experiment(games: &Games) -> ExperimentText {
    experiment_of(games.first())
}

/// Returns the default experiment of a game. A game without its own experiment gets the simplest: SCORE-PPO in its
/// first mode, from the recording in `demos/` with the game's name.
pub fn experiment_of(game: &dyn Game) -> ExperimentText {
    game.tools().training.experiment().unwrap_or_else(|| ExperimentText {
        origin: format!("the experiment of {}", game.name()).into(),
        text: plainest(game).into(),
    })
}

fn plainest(game: &dyn Game) -> String {
    let (name, mode) = (game.name(), game.modes().first().copied().unwrap_or_default());
    let last = LEVELS - 1;
    format!(
        "(game: \"{name}\", train: \"{mode}:0..{last}\", test: \"{mode}:{LEVELS}..{}\", demos: \"demos/{name}\", \
         steps: 500000)",
        2 * LEVELS - 1
    )
}

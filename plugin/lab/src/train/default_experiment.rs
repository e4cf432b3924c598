//! The experiment that serves where none is named.

use crate::{experiment_text::ExperimentText, game::Game, games::Games};

/// Levels to train on, and as many behind them to test on, of a game that names no experiment of its own.
const LEVELS: u64 = 64;

/// The experiment of a program's first game, see [`experiment_of`].
pub fn default_experiment(games: &Games) -> ExperimentText {
    experiment_of(games.first())
}

/// The experiment of a game where none is named. A game that has none of its own gets the plainest: SCORE-PPO in its first
/// mode, from recordings in `demos/` and the game's name.
pub fn experiment_of(game: &dyn Game) -> ExperimentText {
    game.experiment().unwrap_or_else(|| ExperimentText {
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

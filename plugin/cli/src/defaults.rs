//! What is played where nobody names a mode or levels.

use playbot_lab::{game::Game, split::LevelSplit};

/// The mode of verbs that show one level to people, or let them play it: the game's last one, which is the hardest where
/// modes are difficulties.
pub fn mode_to_show(game: &dyn Game) -> &'static str {
    game.modes().last().copied().unwrap_or_default()
}

/// The mode of verbs that record, check or measure: the game's first one, as in the experiment of a game that has none of
/// its own.
pub fn mode_to_measure(game: &dyn Game) -> &'static str {
    game.modes().first().copied().unwrap_or_default()
}

/// Levels 0 to `last` of the mode of verbs that record, check or measure.
pub fn first_levels(game: &dyn Game, last: u64) -> LevelSplit {
    LevelSplit { mode: mode_to_measure(game).to_owned(), first: 0, last }
}

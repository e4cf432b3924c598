//! The games of this crate.

use bevy_playbot::unknown_name::UnknownName;
use playbot_lab::{game::Game, games::Games};

use crate::{ant::Ant, antmaze::AntMaze, coinrun::CoinRun, maze2d::Maze2d, with_rays::WithRays};

/// All games, CoinRun first.
pub const GAMES: [&dyn Game; 6] = [
    &CoinRun { physics: false },
    &Maze2d { physics: false },
    &WithRays(Maze2d { physics: false }),
    &Ant,
    &AntMaze,
    &WithRays(AntMaze),
];

/// The game with this name.
///
/// # Errors
///
/// [`UnknownName`] with the valid names.
pub fn game(name: &str) -> Result<&'static dyn Game, UnknownName> {
    Games::new(&GAMES).expect("each has a name of its own").get(name)
}

//! The games of this crate.

use playbot_lab::game::Game;

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

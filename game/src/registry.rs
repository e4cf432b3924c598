//! The games of this crate.

use crate::{
    ant::Ant,
    antmaze::AntMaze,
    coinrun::CoinRun,
    maze2d::Maze2d,
    senses::{WithMap, WithObservations, WithPositionalEncoding, WithRays},
};
use playbot_harness::game::Game;

/// All games, CoinRun first.
pub const GAMES: [&dyn Game; 10] = [
    &CoinRun { physics: false },
    &Maze2d { physics: false },
    &WithObservations(Maze2d { physics: false }, WithRays),
    &WithObservations(Maze2d { physics: false }, WithMap),
    &WithObservations(Maze2d { physics: false }, WithPositionalEncoding),
    &Ant,
    &AntMaze,
    &WithObservations(AntMaze, WithRays),
    &WithObservations(AntMaze, WithMap),
    &WithObservations(AntMaze, WithPositionalEncoding),
];

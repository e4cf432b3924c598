//! The games of this crate.

use crate::{
    ant::Ant,
    antmaze::AntMaze,
    coinrun::CoinRun,
    maze2d::Maze2d,
    senses::{Mapped, Placed, Sighted, WithSenses},
};
use playbot_harness::game::Game;

/// All games, CoinRun first.
pub const GAMES: [&dyn Game; 10] = [
    &CoinRun { physics: false },
    &Maze2d { physics: false },
    &WithSenses(Maze2d { physics: false }, Sighted),
    &WithSenses(Maze2d { physics: false }, Mapped),
    &WithSenses(Maze2d { physics: false }, Placed),
    &Ant,
    &AntMaze,
    &WithSenses(AntMaze, Sighted),
    &WithSenses(AntMaze, Mapped),
    &WithSenses(AntMaze, Placed),
];

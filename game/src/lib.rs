//! The games that come with `bevy_playbot`: CoinRun, mazes and ants.
//!
//! - [`ant`]: the quadruped, and the open floor on which it learns to walk.
//! - [`coinrun`]: the platformer, level for level and tick for tick the one of the literature.
//! - [`maze`]: mazes on a grid, fixed ones and generated ones, and paths through them.
//! - [`maze2d`]: the ball in a maze, step for step D4RL's.
//! - [`antmaze`]: a quadruped walks through a maze to a goal it does not see.
//! - [`senses`]: the mazes with more observations: rays and goal, a map, or positional encoding.
//! - [`GAMES`]: all of them, for the program `playbot`.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

pub mod ant;
pub mod antmaze;
pub mod coinrun;
pub mod maze;
pub mod maze2d;
mod pictures;
pub mod senses;
#[cfg(test)]
mod watched;

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

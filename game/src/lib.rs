//! The games that come with `bevy_playbot`: CoinRun, mazes and ants.
//!
//! - [`ant`]: the quadruped, and the open floor on which it learns to walk.
//! - [`coinrun`]: the platformer, level for level and tick for tick the one that the literature measures on.
//! - [`maze`]: mazes on a grid, fixed ones and endless ones, and the way through them.
//! - [`maze2d`]: the ball in a maze, step for step D4RL's.
//! - [`antmaze`]: a quadruped walks through a maze to a goal it does not see.
//! - [`senses`]: the mazes for agents that see walls and goal, and for those that know the map.
//! - [`registry`]: all of them, for the program `playbot`.

pub mod ant;
pub mod antmaze;
mod arena_grid;
pub mod coinrun;
mod defect_variant;
pub mod maze;
pub mod maze2d;
pub mod registry;
pub mod senses;
#[cfg(test)]
mod watched;

//! The games of `bevy_playbot` and its command line.
//!
//! - [`ant`]: the quadruped, and the open floor on which it learns to walk.
//! - [`coinrun`]: the platformer, level for level and tick for tick the one that the literature measures on.
//! - [`maze`]: mazes on a grid, fixed ones and endless ones, and the way through them.
//! - [`maze2d`]: the ball in a maze, step for step D4RL's.
//! - [`antmaze`]: a quadruped walks through a maze to a goal it does not see.
//! - [`sighted`]: the mazes for agents that see walls and goal.
//! - [`registry`]: games by name.
//! - [`cli`]: the program `playbot`.
//! - `window`, with the feature of that name: a person plays.

pub mod ant;
pub mod antmaze;
mod arena_grid;
pub mod cli;
pub mod coinrun;
pub mod maze;
pub mod maze2d;
pub mod registry;
pub mod sighted;
#[cfg(feature = "window")]
pub mod window;

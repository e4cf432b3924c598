//! AntMaze: a quadruped walks through a maze to a goal that it does not see.
//!
//! The task is D4RL's, on its maps and on generated ones; the body is [`ant`](crate::ant)'s. A mode ([`AntMazeMode`])
//! and a seed make a level ([`generate`]); each agent has a physics world of its own. Episodes end at the goal or at
//! the time limit, never because the ant has fallen over. [`AntMazeWithRays`] is the same game with rays to the walls
//! and the direction of the goal, [`AntMazeWithMap`] with a map, and [`AntMazeWithWaves`] with positional encoding.

mod against_rules;
mod arena;
pub mod components;
mod defects;
mod demonstrator_bot;
mod floor_plan;
pub mod game;
pub mod geometry;
pub mod level;
mod level_text;
mod levels;
pub mod mode;
pub mod picture;
pub mod play;
pub mod plugin;
pub mod senses;
pub mod view;
pub mod walls;
pub mod waypoints;

pub use demonstrator_bot::DemonstratorBot;
pub use game::AntMaze;
pub use level::{AntMazeLevel, generate};
pub use mode::{AntMazeMode, GoalNoise, Goals, Pay};
pub use plugin::{AntMazePlugin, AntMazeSystems};
pub use senses::{AntMazeWithMap, AntMazeWithRays, AntMazeWithWaves};
pub use walls::wall_boxes;
pub use waypoints::Waypoints;

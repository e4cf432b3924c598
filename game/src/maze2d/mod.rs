//! Maze2D: push a ball through a maze to the goal. D4RL's `pointmaze`, and generated mazes.
//!
//! [`ball`], [`soft_contact`] and [`sim`] are the rules, without an engine. With [`Contact::Soft`] they reproduce the
//! original (MuJoCo 3.1.6) to within rounding; with [`Contact::Rapier`] rapier2d solves the contacts ([`physics`]). A
//! [`Maze2dMode`] names the map and the rules in which the paper and D4RL differ; a [`Maze2dLevel`] is made from it and
//! a seed. [`Maze2dWithRays`] is the same game with rays to the walls and the direction of the goal, [`Maze2dWithMap`]
//! with a map, and [`Maze2dWithWaves`] with positional encoding.

mod against_rules;
pub mod arena;
pub mod ball;
pub mod components;
mod defects;
pub mod demonstrator;
mod demonstrator_bot;
mod draws;
mod floor_plan;
pub mod game;
pub mod level;
mod level_text;
mod levels;
pub mod mode;
pub mod physics;
pub mod picture;
mod play;
pub mod plugin;
mod ray;
mod rules_text;
pub mod senses;
pub mod sim;
pub mod soft_contact;
mod trace;
pub mod walls;

pub use ball::Ball;
pub use demonstrator::Demonstrator;
pub use demonstrator_bot::DemonstratorBot;
pub use game::Maze2d;
pub use level::Maze2dLevel;
pub use mode::{Contact, Maze2dMode};
pub use plugin::{Maze2dPlugin, Maze2dSystems};
pub use senses::{Maze2dWithMap, Maze2dWithRays, Maze2dWithWaves};

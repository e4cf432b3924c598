//! CoinRun: run, jump, avoid saws, enemies and lava, reach the coin.
//!
//! The rules and the level generator reproduce Procgen's CoinRun exactly and do not depend on an engine. [`generate`]
//! makes a [`Level`] from a mode and a seed, [`Sim`] plays it. The functions in [`rules`] are the single steps of play,
//! for callers that keep the state elsewhere.

pub mod arena;
mod cells;
pub mod components;
mod creation_order;
mod defects;
mod demonstrator_bot;
mod detectors;
mod floor_plan;
pub mod game;
pub mod generator;
pub mod level;
mod level_text;
mod level_tiles;
mod levels;
pub mod near;
pub mod paths;
pub mod physics;
pub mod picture;
pub mod planner;
mod play;
pub mod plugin;
pub mod procgen_levels;
mod proof;
pub mod rules;
mod show_level;
pub mod sim;
mod spawn;
mod systems;
pub mod text;
mod tie_breaks;
pub mod tile;
pub mod view;
mod view_size;

pub use demonstrator_bot::DemonstratorBot;
pub use game::CoinRun;
pub use generator::generate;
pub use level::{GoldenLevel, Level, LevelParts, Mode};
pub use planner::{Demonstrator, Plan, PlannerConfig, plan};
pub use plugin::CoinRunPlugin;
pub use procgen_levels::{LevelSet, ProcgenLevels};
pub use rules::{Body, Outcome, PlayerState, PlayerStep};
pub use sim::{Sim, StepResult};
pub use spawn::Spawn;
pub use systems::CoinRunSystems;
pub use tile::{SIZE, Tile, TileGrid};

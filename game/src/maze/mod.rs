//! Mazes on a grid, without an engine: fixed maps, a generator and a planner, for every game that is played in one.
//!
//! A [`Maze`] is rows of wall and free [`Cell`]s with a start and a reachable goal. The size of a cell and the
//! direction of its axes belong to the game. [`fixed`] has the maps of the literature, [`generate`] makes mazes from a
//! [`MazeSpec`] and a seed, and [`Planner`] finds paths to a goal from everywhere.

mod cell;
pub(crate) mod defects;
mod distances;
mod draw;
mod ends;
mod error;
pub mod fixed;
mod floor_plan;
mod generator;
mod layout;
mod limits;
mod map;
mod maze_text;
mod mode_error;
mod paid;
mod planner;
pub mod proof;
mod rooms;
pub mod show_level;
mod spec;
mod spec_text;
mod text;
mod walls;

pub use cell::Cell;
pub use distances::Distances;
pub use error::MazeError;
pub use generator::generate;
pub use layout::Maze;
pub use limits::{MAX_CELLS, MAX_SIDE};
pub use map::Map;
pub use maze_text::read_maze;
pub use mode_error::{MazeModeError, read_mode};
pub(crate) use paid::paid_otherwise;
pub use planner::{GridMove, Planner};
pub use spec::{HELD_OUT_SEEDS, MazeSpec, TRAIN_SEEDS};
pub use spec_text::OptionError;

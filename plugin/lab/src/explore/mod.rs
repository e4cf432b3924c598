//! Exploring a level without training and without knowledge of the game: Go-Explore (Ecoffet et al. 2021, "First
//! return, then explore") over exact replay.
//!
//! An archive holds the reached [`Cell`]s, each with the shortest known path to it. Each visit draws a rarely seen
//! cell, returns to it by the same actions, and explores from there. A game need not store its state: it must be
//! deterministic, so the level and the actions restore it. A game that is not deterministic causes an error at the
//! first tick that differs.
//!
//! Games with positions ([`StateTools::position`](crate::game::StateTools::position)) have a grid of cells over the
//! level. Others have cells of their own ([`StateTools::explore_cell`](crate::game::StateTools::explore_cell)), or else
//! cells of rounded observations.
//!
//! ```no_run
//! use std::ops::ControlFlow;
//!
//! use playbot_lab::{explore::{ExplorePlan, explore}, prelude::*};
//! # fn example(game: &dyn Game) -> Result<(), Box<dyn std::error::Error>> {
//! let plan = ExplorePlan { steps: 100_000, ..ExplorePlan::new("easy", 7) };
//! let found = explore(game, &plan, |_| {}, |_| ControlFlow::Continue(()))?;
//! println!("{}", found.summary(game));
//! if let Some(solution) = found.solution() {
//!     println!("solved in {} ticks", solution.len());
//! }
//! # Ok(())
//! # }
//! ```

mod archive;
mod cell;
mod check_cell;
mod error;
mod exploration;
mod explorer;
mod grid;
mod job;
mod lookout;
mod open_cells;
mod passed;
mod plan;
mod play_route;
mod round;
mod summary;
mod until;
mod visit;
mod ways;
mod world;

pub use archive::ReachedCell;
pub use cell::{Cell, NoCell};
pub use check_cell::check_cell;
pub use error::ExploreError;
pub use exploration::{EndCounts, Exploration, Stop};
pub use explorer::Explorer;
pub use grid::CellGrid;
pub use open_cells::open_cells;
pub(crate) use passed::{cells_between, reach};
pub use plan::ExplorePlan;
pub use play_route::{follow_route, record_route};
pub use round::{Round, explore};
pub use summary::ExplorationSummary;
pub use until::Until;
pub use ways::Route;

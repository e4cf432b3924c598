//! The result of an exploration.

use std::collections::{BTreeMap, BTreeSet};

use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};
use serde::Serialize;

use super::{
    archive::{Archive, ReachedCell},
    cell::Cell,
    grid::CellGrid,
    ways::Route,
};

/// The reason why an exploration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// The budget is used up.
    Spent,
    /// A solution was found.
    Solved,
    /// All open cells were reached, and a solution was found if the level has a goal.
    Covered,
    /// The caller stopped it.
    Asked,
}

/// Counts of the ends of episodes, without visits that just stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct EndCounts {
    /// Terminated at the goal.
    pub won: u64,
    /// Terminated elsewhere.
    pub lost: u64,
    /// Truncated by the time limit.
    pub out_of_time: u64,
}

impl EndCounts {
    pub(super) fn count(&mut self, end: Option<EpisodeResult>) {
        match end.map(|end| end.end) {
            Some(EpisodeEnd::Terminated { success: true }) => self.won += 1,
            Some(EpisodeEnd::Terminated { success: false }) => self.lost += 1,
            Some(EpisodeEnd::Truncated) => self.out_of_time += 1,
            None => {}
        }
    }
}

/// Cells with the shortest known paths to them, and further results on a level.
pub struct Exploration {
    /// Mode of the game.
    pub mode: String,
    /// Number of the level.
    pub level: u64,
    /// Random seed.
    pub seed: u64,
    /// Name of the explorer.
    pub explorer: &'static str,
    /// Environment steps, with the paths back.
    pub steps: u64,
    /// Visits.
    pub visits: u64,
    /// Ends of their episodes.
    pub ends: EndCounts,
    /// Steps and cells after each round.
    pub curve: Vec<(u64, u64)>,
    /// The reason why it ended.
    pub stop: Stop,
    /// The squares of the cells; `None` if cells are not positions.
    pub grid: Option<CellGrid>,
    /// Whether the level is known to have a goal, by its floor plan.
    pub has_goal: bool,
    /// The cells that no wall cuts off from the start, if cells are positions and there is a floor plan: see
    /// [`open_cells`](super::open_cells()).
    pub open: Option<BTreeSet<Cell>>,
    pub(super) archive: Archive,
}

impl Exploration {
    /// Returns all cells that were reached, in their order.
    pub fn cells(&self) -> &BTreeMap<Cell, ReachedCell> {
        self.archive.cells()
    }

    /// Returns the shortest known path to a cell, with the state hash after each tick. The last hash is that on
    /// arrival, or that after a cell that is only passed.
    pub fn route_to(&self, cell: &Cell) -> Option<Route> {
        self.archive.route_to(cell)
    }

    /// Returns the shortest known path to the level's goal.
    pub fn solution(&self) -> Option<Route> {
        self.archive.solution().map(|way| self.archive.route(way))
    }

    /// Returns the ticks of the [`solution`](Self::solution).
    pub fn solution_ticks(&self) -> Option<u32> {
        self.archive.solution().map(|way| way.ticks)
    }

    /// Returns the open cells that were not reached.
    pub fn missed(&self) -> impl Iterator<Item = &Cell> {
        self.open.iter().flatten().filter(move |cell| !self.cells().contains_key(cell))
    }

    /// Returns how many of the open cells were reached; `None` if the open cells are unknown.
    pub fn open_reached(&self) -> Option<usize> {
        Some(self.open.as_ref()?.len() - self.missed().count())
    }

    /// Returns the share of the open cells that were reached; `None` if the open cells are unknown.
    pub fn coverage(&self) -> Option<f64> {
        let open = self.open.as_ref().map(BTreeSet::len)?;
        Some(self.open_reached()? as f64 / open.max(1) as f64)
    }
}

//! What an exploration has found.

use std::collections::{BTreeMap, BTreeSet};

use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};
use serde::Serialize;

use super::{
    archive::{Archive, ReachedCell},
    cell::Cell,
    grid::CellGrid,
    ways::Route,
};

/// Why an exploration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// The budget is used up.
    Spent,
    /// A solution was found.
    Solved,
    /// All cells that are open were reached, and a solution was found if the level has a goal.
    Covered,
    /// Somebody asked for it.
    Asked,
}

/// How the episodes of visits ended that did not just stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct EndCounts {
    /// Terminated, with the aim reached.
    pub won: u64,
    /// Terminated without.
    pub lost: u64,
    /// Truncated: time was up.
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

/// Cells with the shortest ways that were found to them, and what else is known of a level.
pub struct Exploration {
    /// Mode of the game.
    pub mode: String,
    /// Number of the level.
    pub level: u64,
    /// Seed of what was drawn.
    pub seed: u64,
    /// Who explored.
    pub explorer: &'static str,
    /// Environment steps, ways back included.
    pub steps: u64,
    /// Visits.
    pub visits: u64,
    /// How their episodes ended.
    pub ends: EndCounts,
    /// Steps and cells after each round.
    pub curve: Vec<(u64, u64)>,
    /// Why it ended.
    pub stop: Stop,
    /// The squares that cells are; `None` where they are no places.
    pub grid: Option<CellGrid>,
    /// Whether the level is known to have a goal: its floor plan shows one.
    pub has_goal: bool,
    /// The cells that no wall cuts off from the start, where cells are places and the floor plan says it: see
    /// [`open_cells`](super::open_cells()).
    pub open: Option<BTreeSet<Cell>>,
    pub(super) archive: Archive,
}

impl Exploration {
    /// All cells that were reached, in their order.
    pub fn cells(&self) -> &BTreeMap<Cell, ReachedCell> {
        self.archive.cells()
    }

    /// The shortest way that was found to a cell, with the state hash after each tick; its last one is that on arrival,
    /// or that behind a cell that is only passed.
    pub fn route_to(&self, cell: &Cell) -> Option<Route> {
        self.archive.route_to(cell)
    }

    /// The shortest way that was found on which the level's aim was reached.
    pub fn solution(&self) -> Option<Route> {
        self.archive.solution().map(|way| self.archive.route(way))
    }

    /// Ticks of the [`solution`](Self::solution).
    pub fn solution_ticks(&self) -> Option<u32> {
        self.archive.solution().map(|way| way.ticks)
    }

    /// The cells that are open and were not reached.
    pub fn missed(&self) -> impl Iterator<Item = &Cell> {
        self.open.iter().flatten().filter(move |cell| !self.cells().contains_key(cell))
    }

    /// How many of the open cells were reached; `None` if nobody knows how many there are.
    pub fn open_reached(&self) -> Option<usize> {
        Some(self.open.as_ref()?.len() - self.missed().count())
    }

    /// The share of the open cells that were reached; `None` if nobody knows how many there are.
    pub fn coverage(&self) -> Option<f64> {
        let open = self.open.as_ref().map(BTreeSet::len)?;
        Some(self.open_reached()? as f64 / open.max(1) as f64)
    }
}

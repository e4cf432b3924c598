//! In which cell an agent is.

use std::collections::BTreeSet;

use bevy::prelude::*;
use bevy_playbot::observation::Observation;

use super::{
    cell::Cell,
    grid::CellGrid,
    passed::{cells_between, reach},
};
use crate::game::Game;

/// Steps to which observed values are rounded where nobody says it.
const FINENESS: f32 = 0.125;

/// What cells are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CellKind {
    /// What the game says.
    Own,
    /// Places on a grid.
    Places,
    /// Observed values, downscaled.
    Values,
}

/// Tells cells apart.
#[derive(Clone, Copy)]
pub(super) struct Lookout<'a> {
    grid: CellGrid,
    /// The cells that can be passed.
    open: Option<&'a BTreeSet<Cell>>,
    /// How far an agent goes in a tick at most.
    reach: f32,
    fineness: f32,
    kind: Option<CellKind>,
}

/// A cell, and after how many ticks of the episode the agent was in it.
pub(super) struct Spotted {
    pub ticks: u32,
    pub cell: Cell,
    /// Where that is, where cells are places.
    pub place: Option<Vec2>,
    /// The open cells that it has passed on its way there from the place where it was a tick before.
    pub passed: Vec<Cell>,
}

impl<'a> Lookout<'a> {
    /// For cells of this grid, unless the game says which cells there are, or does not say where agents are. Of the cells
    /// that are passed between two ticks those that are open count, if they are known; tiles are as long as `tile`.
    pub fn new(grid: CellGrid, cell_size: Option<f32>, open: Option<&'a BTreeSet<Cell>>, tile: f32) -> Self {
        Self { grid, open, reach: reach(tile), fineness: cell_size.unwrap_or(FINENESS), kind: None }
    }

    /// Whether cells are squares of the grid; false as long as nobody has been seen.
    pub fn has_places(&self) -> bool {
        self.kind == Some(CellKind::Places)
    }

    /// The cell of an agent that has played so many ticks, and was in a place a tick before, if that is known. An observation
    /// is older by a tick: it is made before the action.
    pub fn spot(
        &mut self,
        game: &dyn Game,
        world: &World,
        agent: Entity,
        ticks: u32,
        before: Option<Vec2>,
    ) -> Option<Spotted> {
        let alone = |ticks, cell| Spotted { ticks, cell, place: None, passed: Vec::new() };
        match *self.kind.get_or_insert_with(|| kind_of(game, world, agent)) {
            CellKind::Own => game.explore_cell(world, agent).map(|cell| alone(ticks, Cell(cell))),
            CellKind::Places => {
                let place = game.whereabouts(world, agent)?;
                let cell = self.grid.cell_at(place)?;
                let passed = before.map_or_else(Vec::new, |before| self.passed(before, place));
                Some(Spotted { ticks, cell, place: Some(place), passed })
            }
            CellKind::Values => {
                let values = &world.get::<Observation>(agent)?.vector;
                let cell = values.iter().map(|value| (value / self.fineness).floor() as i32).collect();
                Some(alone(ticks.checked_sub(1)?, Cell(cell)))
            }
        }
    }

    /// The open cells between two places.
    fn passed(&self, from: Vec2, to: Vec2) -> Vec<Cell> {
        let Some(open) = self.open else { return Vec::new() };
        let between = cells_between(self.grid, from, to, self.reach).map(|cell| Cell(cell.to_vec()));
        between.filter(|cell| open.contains(cell)).collect()
    }
}

fn kind_of(game: &dyn Game, world: &World, agent: Entity) -> CellKind {
    if game.explore_cell(world, agent).is_some() {
        CellKind::Own
    } else if game.whereabouts(world, agent).is_some() {
        CellKind::Places
    } else {
        CellKind::Values
    }
}

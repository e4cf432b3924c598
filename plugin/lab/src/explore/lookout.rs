//! The cell of an agent after each tick.

use std::collections::BTreeSet;

use bevy::prelude::*;
use bevy_playbot::observation::Observation;

use super::{
    cell::Cell,
    grid::CellGrid,
    passed::{cells_between, reach},
};
use crate::game::Game;

/// Default step to which observed values are rounded.
const FINENESS: f32 = 0.125;

/// The kind of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CellKind {
    /// The game's own cells.
    Own,
    /// Positions on a grid.
    Places,
    /// Rounded observations.
    Values,
}

/// Computes the cells of agents.
#[derive(Clone, Copy)]
pub(super) struct Lookout<'a> {
    grid: CellGrid,
    /// The cells that can be passed.
    open: Option<&'a BTreeSet<Cell>>,
    /// The farthest that an agent moves in a tick.
    reach: f32,
    fineness: f32,
    kind: Option<CellKind>,
}

/// A cell, and the tick of the episode in which the agent was there.
pub(super) struct Spotted {
    pub ticks: u32,
    pub cell: Cell,
    /// Position of the agent, if cells are positions.
    pub place: Option<Vec2>,
    /// The open cells that it passed since the position of the tick before.
    pub passed: Vec<Cell>,
}

impl<'a> Lookout<'a> {
    /// Creates it for cells of this grid, unless the game has its own cells, or reports no positions. Of the cells that
    /// are passed between two ticks only open ones count, if they are known. `tile` is the side of a tile.
    pub fn new(grid: CellGrid, cell_size: Option<f32>, open: Option<&'a BTreeSet<Cell>>, tile: f32) -> Self {
        Self { grid, open, reach: reach(tile), fineness: cell_size.unwrap_or(FINENESS), kind: None }
    }

    /// Returns whether cells are squares of the grid; false before the first agent was seen.
    pub fn has_places(&self) -> bool {
        self.kind == Some(CellKind::Places)
    }

    /// Returns the cell of an agent after this many ticks, with its position a tick before, if that is known. An
    /// observation is older by a tick, since it is made before the action.
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
            CellKind::Own => game.tools().state.explore_cell(world, agent).map(|cell| alone(ticks, Cell(cell))),
            CellKind::Places => {
                let place = game.tools().state.position(world, agent)?;
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

    /// Returns the open cells between two positions.
    fn passed(&self, from: Vec2, to: Vec2) -> Vec<Cell> {
        let Some(open) = self.open else { return Vec::new() };
        let between = cells_between(self.grid, from, to, self.reach).map(|cell| Cell(cell.to_vec()));
        between.filter(|cell| open.contains(cell)).collect()
    }
}

fn kind_of(game: &dyn Game, world: &World, agent: Entity) -> CellKind {
    if game.tools().state.explore_cell(world, agent).is_some() {
        CellKind::Own
    } else if game.tools().state.position(world, agent).is_some() {
        CellKind::Places
    } else {
        CellKind::Values
    }
}

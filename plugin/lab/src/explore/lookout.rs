//! In which cell an agent is.

use bevy::prelude::*;
use bevy_playbot::observation::Observation;

use super::{cell::Cell, grid::CellGrid};
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
pub(super) struct Lookout {
    grid: CellGrid,
    fineness: f32,
    kind: Option<CellKind>,
}

/// A cell, and after how many ticks of the episode the agent was in it.
pub(super) struct Spotted {
    pub ticks: u32,
    pub cell: Cell,
}

impl Lookout {
    /// For cells of this grid, unless the game says which cells there are, or does not say where agents are.
    pub fn new(grid: CellGrid, cell_size: Option<f32>) -> Self {
        Self { grid, fineness: cell_size.unwrap_or(FINENESS), kind: None }
    }

    /// Whether cells are squares of the grid; false as long as nobody has been seen.
    pub fn has_places(&self) -> bool {
        self.kind == Some(CellKind::Places)
    }

    /// The cell of an agent that has played so many ticks. An observation is older by a tick: it is made before the action.
    pub fn spot(&mut self, game: &dyn Game, world: &World, agent: Entity, ticks: u32) -> Option<Spotted> {
        match *self.kind.get_or_insert_with(|| kind_of(game, world, agent)) {
            CellKind::Own => game.explore_cell(world, agent).map(|cell| Spotted { ticks, cell: Cell(cell) }),
            CellKind::Places => {
                let place = game.whereabouts(world, agent)?;
                self.grid.cell_at(place).map(|cell| Spotted { ticks, cell })
            }
            CellKind::Values => {
                let values = &world.get::<Observation>(agent)?.vector;
                let cell = values.iter().map(|value| (value / self.fineness).floor() as i32).collect();
                Some(Spotted { ticks: ticks.checked_sub(1)?, cell: Cell(cell) })
            }
        }
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

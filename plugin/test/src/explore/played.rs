//! The cells that a player reaches in episodes of its own, to be set beside those of an exploration.

use crate::explore::{
    Exploration, ExploreError, ExploredCell,
    cell::{CellGrid, cells_between, reach},
};
use bevy::math::Vec2;
use bevy_playbot::vision::ObservationConfig;
use playbot_harness::{
    eval::{EvalPlan, Player, evaluate_with_trails},
    game::Game,
    randomise::Randomise,
    split::LevelSplit,
};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Most episodes that are played before their cells are counted.
const EPISODES_AT_A_TIME: u64 = 1024;

/// The cells of a player in episodes from the level's start, for as many ticks as an exploration took.
#[derive(Clone, Debug, PartialEq)]
pub struct PlayedCells {
    /// The ticks in each cell. Cells that are only passed between two ticks have 0.
    pub cells: BTreeMap<ExploredCell, u64>,
    /// Ticks of all episodes.
    pub ticks: u64,
    /// Episodes; the last one may be cut off.
    pub episodes: u64,
    /// Episodes that ended at the goal.
    pub won: u64,
}

/// The comparison of a player's cells with an explorer's.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlayedSummary {
    /// Ticks of all episodes.
    pub ticks: u64,
    /// Episodes; the last one may be cut off.
    pub episodes: u64,
    /// Episodes that ended at the goal.
    pub won: u64,
    /// Cells that the player reached, open or not.
    pub cells: usize,
    /// Number of open cells among these; `None` if the open cells are unknown.
    pub open_cells_reached: Option<usize>,
    /// The share of the open cells that the player reached.
    pub coverage: Option<f64>,
    /// Cells that both reached.
    pub both: usize,
    /// Cells that only the player reached.
    pub only_player: usize,
    /// Cells that only the explorer reached.
    pub only_explorer: usize,
}

impl PlayedCells {
    /// Plays episodes of the exploration's level until as many ticks are played as the exploration took.
    ///
    /// They are played one after the other, so that their number and the end of the last one depend on nothing else. Of
    /// the cells that are passed between two ticks only open ones count, as in explorations.
    ///
    /// # Errors
    ///
    /// [`ExploreError::Plan`] if cells are not positions; else the game broke its contract, or cannot be observed this
    /// way.
    pub fn play(
        game: &dyn Game,
        exploration: &Exploration,
        player: &Player,
        observation_config: ObservationConfig,
    ) -> Result<Self, ExploreError> {
        let Exploration { mode, level, seed, steps, grid, open, .. } = exploration;
        let without = || {
            let why = "its cells are no positions, and only positions of episodes can be set beside an exploration";
            ExploreError::Plan(format!("`{}` {mode}:{level}: {why}", game.name()))
        };
        let grid = grid.ok_or_else(without)?;
        let tile = CellGrid::new(game.tools().levels.floor_plan(mode, *level).as_ref(), None).size;
        let mut played = Self { cells: BTreeMap::new(), ticks: 0, episodes: 0, won: 0 };
        for round in 0.. {
            let left = steps.saturating_sub(played.ticks);
            if left == 0 {
                break;
            }
            let mean = played.ticks / played.episodes.max(1);
            let episodes = if played.episodes == 0 { 1 } else { left.div_ceil(mean.max(1)).min(EPISODES_AT_A_TIME) };
            let plan = EvalPlan {
                split: LevelSplit { mode: mode.clone(), first: *level, last: *level },
                left_out: BTreeSet::new(),
                observation_config,
                episodes_per_level: u32::try_from(episodes).unwrap_or(u32::MAX),
                seed: seed.wrapping_add(round),
                arenas: 1,
                worlds: 1,
                threads: 1,
                randomise: Randomise::default(),
            };
            for trail in evaluate_with_trails(game, player, &plan, |_| {})? {
                let left = steps.saturating_sub(played.ticks);
                if left == 0 {
                    break;
                }
                if trail.positions.is_empty() {
                    return Err(without());
                }
                let is_whole = trail.positions.len() as u64 <= left;
                let ticks = trail.positions.len().min(usize::try_from(left).unwrap_or(usize::MAX));
                played.add(grid, open.as_ref(), reach(tile), &trail.positions[..ticks]);
                played.won += u64::from(is_whole && trail.result.success);
            }
        }
        Ok(played)
    }

    fn add(&mut self, grid: CellGrid, open: Option<&BTreeSet<ExploredCell>>, reach: f32, positions: &[Vec2]) {
        self.episodes += 1;
        self.ticks += positions.len() as u64;
        for position in positions {
            if let Some(cell) = grid.cell_at(*position) {
                *self.cells.entry(cell).or_insert(0) += 1;
            }
        }
        let Some(open) = open else { return };
        for pair in positions.windows(2) {
            let between = cells_between(grid, pair[0], pair[1], reach).map(|cell| ExploredCell(cell.to_vec()));
            for cell in between.filter(|cell| open.contains(cell)) {
                self.cells.entry(cell).or_insert(0);
            }
        }
    }

    /// Returns the open cells that were not reached.
    pub fn missed<'a>(&'a self, exploration: &'a Exploration) -> impl Iterator<Item = &'a ExploredCell> {
        exploration.open.iter().flatten().filter(|cell| !self.cells.contains_key(cell))
    }

    /// Compares them with the cells of the exploration.
    pub fn summary(&self, exploration: &Exploration) -> PlayedSummary {
        let Self { cells, ticks, episodes, won } = self;
        let open_cells = exploration.open.as_ref().map(BTreeSet::len);
        let reached = open_cells.map(|all| all - self.missed(exploration).count());
        let both = cells.keys().filter(|cell| exploration.cells().contains_key(cell)).count();
        PlayedSummary {
            ticks: *ticks,
            episodes: *episodes,
            won: *won,
            cells: cells.len(),
            open_cells_reached: reached,
            coverage: open_cells.zip(reached).map(|(all, reached)| reached as f64 / all.max(1) as f64),
            both,
            only_player: cells.len() - both,
            only_explorer: exploration.cells().len() - both,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_counted_in_their_cells_and_passed_cells_if_they_are_open() {
        let mut played = PlayedCells { cells: BTreeMap::new(), ticks: 0, episodes: 0, won: 0 };
        let grid = CellGrid { origin: Vec2::ZERO, size: 1.0 };
        let cell = |column| ExploredCell(vec![column, 0]);
        let open = BTreeSet::from([cell(0), cell(1), cell(3)]);
        let at = |x| Vec2::new(x, 0.5);
        played.add(grid, Some(&open), reach(1.0), &[at(0.5), at(0.6), at(2.5), at(90.5)]);
        assert_eq!((played.ticks, played.episodes), (4, 1));
        assert_eq!(played.cells, BTreeMap::from([(cell(0), 2), (cell(1), 0), (cell(2), 1), (cell(90), 1)]));
        played.add(grid, None, reach(1.0), &[at(2.5), at(0.5)]);
        assert_eq!(played.cells.values().sum::<u64>(), played.ticks);
    }
}

//! D4RL's demonstrator: plans a way over the cells and steers from one to the next.

use std::{collections::VecDeque, sync::Arc};

use playbot_learner::rng::unit;
use rand::Rng;

use super::{
    ball::{Ball, Vec2d, add, length, scale, sub},
    draws::normal,
    level::{Maze2dLevel, any_cell, centre},
};
use crate::maze::{Cell, Planner};

/// The pull of the next waypoint, per metre, and the brake, per metre and second: pushes of 1 are full.
const PULL: f64 = 10.0;
const BRAKE: f64 = 1.0;
/// A waypoint is passed, and a target reached, within this distance, m. The original also asks for less than 0.1 m in
/// the last step; no ball moves faster.
const NEAR: f64 = 0.1;

/// Walks to the goal of a level and stays there, or from one random cell to the next.
#[derive(Clone, Debug)]
pub struct Demonstrator {
    level: Arc<Maze2dLevel>,
    retarget: bool,
    target: Cell,
    planner: Planner,
    /// Where it goes, the next waypoint first, each with the cell it stands for.
    way: VecDeque<(Cell, Vec2d)>,
}

impl Demonstrator {
    /// A demonstrator for a level. `retarget`: it goes to a random cell, and to another when it is there.
    pub fn new(level: Arc<Maze2dLevel>, retarget: bool, rng: &mut impl Rng) -> Self {
        let target = if retarget { any_cell(&level.maze, rng) } else { level.goal_cell };
        let planner = Planner::new(&level.maze, target);
        Self { level, retarget, target, planner, way: VecDeque::new() }
    }

    /// The cell it goes to.
    pub fn target(&self) -> Cell {
        self.target
    }

    /// The push it wants, each axis clipped to -1..=1, with normal noise of this standard deviation.
    pub fn act(&mut self, ball: &Ball, noise: f64, rng: &mut impl Rng) -> Vec2d {
        if self.retarget && length(sub(ball.position, centre(self.target))) < NEAR {
            self.target = any_cell(&self.level.maze, rng);
            self.planner = Planner::new(&self.level.maze, self.target);
            self.way.clear();
        }
        let waypoint = self.waypoint(ball, rng);
        let wanted = sub(scale(sub(waypoint, ball.position), PULL), scale(ball.velocity, BRAKE));
        let noise = if noise > 0.0 { [noise * normal(rng), noise * normal(rng)] } else { [0.0; 2] };
        add(wanted, noise).map(|push| push.clamp(-1.0, 1.0))
    }

    /// The next waypoint that has not been passed.
    fn waypoint(&mut self, ball: &Ball, rng: &mut impl Rng) -> Vec2d {
        while self.way.len() > 1 && length(sub(ball.position, self.way[0].1)) < NEAR {
            self.way.pop_front();
        }
        let here = self.cell_of(ball);
        if self.way.front().is_none_or(|(next, _)| moves_between(here, *next) > 1) {
            self.plan(here, rng);
        }
        self.way.front().map_or_else(|| centre(self.target), |(_, place)| *place)
    }

    /// A new way from a cell. Without one, as from inside a wall, it is left empty.
    fn plan(&mut self, from: Cell, rng: &mut impl Rng) {
        let path = self.planner.path(from).unwrap_or_default();
        let offset = self.level.walls.offset();
        self.way.clear();
        for cell in path {
            let place = if cell == self.target {
                centre(cell)
            } else {
                // Somewhere between where the cell is said to be and where it is.
                centre(cell).map(|along| along - offset * unit(rng))
            };
            self.way.push_back((cell, place));
        }
        // The cell it stands in is where it comes from, unless it is the target.
        if self.way.len() > 1 {
            self.way.pop_front();
        }
    }

    /// The cell that a ball is in; the nearest one inside the map if it were outside.
    fn cell_of(&self, ball: &Ball) -> Cell {
        let (row, col) = self.level.walls.cell_at(ball.position);
        Cell::new(usize::try_from(row).unwrap_or(0), usize::try_from(col).unwrap_or(0))
    }
}

/// Moves between two cells if there were no walls.
fn moves_between(a: Cell, b: Cell) -> usize {
    a.row.abs_diff(b.row) + a.col.abs_diff(b.col)
}

//! D4RL's demonstrator: plans a path over the cells and steers from one to the next.

use crate::{
    maze::{Cell, Planner},
    maze2d::{
        arena::{MazeArena, MazeBall, PlaysIn},
        ball::{Ball, Vec2d, add, length, scale, sub},
        level::{Maze2dLevel, any_cell, centre, normal},
    },
};
use bevy::prelude::*;
use bevy_playbot::streams::AgentStreams;
use playbot_harness::prelude::*;
use playbot_learner::rng::unit;
use rand::Rng;
use std::{collections::VecDeque, sync::Arc};

/// Gain of the distance to the next waypoint, per metre, and of the velocity, per metre and second. A push of 1 is
/// full.
const PULL: f64 = 10.0;

const BRAKE: f64 = 1.0;

/// Distance at which a waypoint is passed, and a target reached, m. The original also requires less than 0.1 m in the
/// last step; no ball moves faster.
const NEAR: f64 = 0.1;

/// Walks to the goal of a level and stays there, or from one random cell to the next.
#[derive(Clone, Debug)]
pub struct Demonstrator {
    level: Arc<Maze2dLevel>,
    retarget: bool,
    target: Cell,
    planner: Planner,
    /// The waypoints, the next one first, each with its cell.
    path: VecDeque<(Cell, Vec2d)>,
}

impl Demonstrator {
    /// Makes a demonstrator for a level. With `retarget` it goes to a random cell, and then to another.
    pub fn new(level: Arc<Maze2dLevel>, retarget: bool, rng: &mut impl Rng) -> Self {
        let target = if retarget { any_cell(&level.maze, rng) } else { level.goal_cell };
        let planner = Planner::new(&level.maze, target);
        Self { level, retarget, target, planner, path: VecDeque::new() }
    }

    /// Returns its target cell.
    pub fn target(&self) -> Cell {
        self.target
    }

    /// Returns its push, each axis clipped to -1..=1, with normal noise of this standard deviation.
    pub fn act(&mut self, ball: &Ball, noise: f64, rng: &mut impl Rng) -> Vec2d {
        if self.retarget && length(sub(ball.position, centre(self.target))) < NEAR {
            self.target = any_cell(&self.level.maze, rng);
            self.planner = Planner::new(&self.level.maze, self.target);
            self.path.clear();
        }
        let waypoint = self.waypoint(ball, rng);
        let wanted = sub(scale(sub(waypoint, ball.position), PULL), scale(ball.velocity, BRAKE));
        let noise = if noise > 0.0 { [noise * normal(rng), noise * normal(rng)] } else { [0.0; 2] };
        add(wanted, noise).map(|push| push.clamp(-1.0, 1.0))
    }

    /// Returns the next waypoint that has not been passed.
    fn waypoint(&mut self, ball: &Ball, rng: &mut impl Rng) -> Vec2d {
        while self.path.len() > 1 && length(sub(ball.position, self.path[0].1)) < NEAR {
            self.path.pop_front();
        }
        let here = self.cell_of(ball);
        if self.path.front().is_none_or(|(next, _)| moves_between(here, *next) > 1) {
            self.plan(here, rng);
        }
        self.path.front().map_or_else(|| centre(self.target), |(_, position)| *position)
    }

    /// Plans a new path from a cell. Without one, as from inside a wall, it is left empty.
    fn plan(&mut self, from: Cell, rng: &mut impl Rng) {
        let path = self.planner.path(from).unwrap_or_default();
        let offset = self.level.walls.offset();
        self.path.clear();
        for cell in path {
            let position = if cell == self.target {
                centre(cell)
            } else {
                // Between the cell's nominal position and its actual one.
                centre(cell).map(|along| along - offset * unit(rng))
            };
            self.path.push_back((cell, position));
        }
        // The cell it stands in is the start of the path, unless it is the target.
        if self.path.len() > 1 {
            self.path.pop_front();
        }
    }

    /// Returns the cell of a ball; outside the map, the nearest one inside.
    fn cell_of(&self, ball: &Ball) -> Cell {
        let (row, col) = self.level.walls.cell_at(ball.position);
        Cell::new(usize::try_from(row).unwrap_or(0), usize::try_from(col).unwrap_or(0))
    }
}

/// Returns the moves between two cells without walls.
fn moves_between(a: Cell, b: Cell) -> usize {
    a.row.abs_diff(b.row) + a.col.abs_diff(b.col)
}

/// Plays by walking from waypoint to waypoint. See [`Demonstrator`].
#[derive(Component, Reflect)]
#[reflect(Component)]
pub struct DemonstratorBot {
    noise: f64,
    /// Made anew at the first tick of an episode.
    #[reflect(ignore)]
    walker: Option<Demonstrator>,
}

impl DemonstratorBot {
    /// Takes the standard deviation of normal noise on each axis of its actions.
    pub fn new(noise: f64) -> Self {
        Self { noise, walker: None }
    }
}

pub(super) fn decide(
    mut bots: Query<(&Control, &Episode, &PlaysIn, &MazeBall, &mut DemonstratorBot, &mut AgentStreams, &mut Action)>,
    arenas: Query<&MazeArena>,
) {
    for (control, episode, plays_in, ball, mut bot, mut streams, mut action) in &mut bots {
        if *control != Control::Bot || !episode.is_running() {
            continue;
        }
        let Ok(arena) = arenas.get(plays_in.0) else { continue };
        let (noise, rng) = (bot.noise, &mut streams.action);
        if episode.tick == 0 {
            bot.walker = None;
        }
        let walker =
            bot.walker.get_or_insert_with(|| Demonstrator::new(arena.level.clone(), arena.rules.retarget, rng));
        let push = walker.act(&ball.0, noise, rng);
        action.0 = ActionValue::Continuous(push.map(|axis| axis as f32).to_vec());
    }
}

//! A level: maze, start and goal, from a mode and a seed.

use playbot_learner::rng::{Streams, below};
use rand::Rng;

use super::{
    ball::{Ball, Vec2d},
    draws::{normal, uniform},
    mode::Maze2dMode,
    walls::Walls,
};
use crate::maze::{Cell, Maze, MazeError};

/// Largest distance of the start from the middle of its cell, along each axis, m.
const START_NOISE: f64 = 0.1;
/// Standard deviation of the velocity at the start, along each axis, m/s.
const START_SPEED: f64 = 0.1;

/// The initial state of an episode.
#[derive(Clone, Debug)]
pub struct Maze2dLevel {
    /// The maze.
    pub maze: Maze,
    /// Its walls in the coordinates of the observation.
    pub walls: Walls,
    /// The cell in which the ball starts.
    pub start_cell: Cell,
    /// The ball at the start.
    pub start: Ball,
    /// The cell of the goal.
    pub goal_cell: Cell,
}

impl Maze2dLevel {
    /// Makes the level with this seed. On the fixed maps the seed decides the start of the ball, on generated ones also
    /// the maze.
    ///
    /// # Errors
    ///
    /// No maze can be generated for this seed.
    pub fn new(mode: &Maze2dMode, seed: u64) -> Result<Self, MazeError> {
        let maze = mode.maze(seed)?;
        let mut rng = Streams::new(seed).stream("maze2d/reset", 0);
        let mut goal_cell = if mode.random_goal { any_cell(&maze, &mut rng) } else { maze.goal() };
        let mut start_cell = if mode.fixed_start { maze.start() } else { any_cell(&maze, &mut rng) };
        while mode.end_at_goal && start_cell == goal_cell {
            // Nothing would be left to play. A free choice is drawn again: one of two free cells is another one.
            *(if mode.fixed_start { &mut goal_cell } else { &mut start_cell }) = any_cell(&maze, &mut rng);
        }
        let position = centre(start_cell).map(|along| along + uniform(&mut rng, START_NOISE));
        let velocity = [(); 2].map(|()| START_SPEED * normal(&mut rng));
        let walls = Walls::new(&maze, mode.wall_offset());
        Ok(Self { maze, walls, start_cell, start: Ball { position, velocity }, goal_cell })
    }

    /// Returns the position of the goal.
    pub fn goal(&self) -> Vec2d {
        centre(self.goal_cell)
    }
}

/// Returns the position of a cell, whatever the offset of the walls: x is its row, y its column.
pub fn centre(cell: Cell) -> Vec2d {
    [cell.row as f64, cell.col as f64]
}

/// Returns a free cell, each with the same chance.
pub(super) fn any_cell(maze: &Maze, rng: &mut impl Rng) -> Cell {
    let count = maze.free_cells().count() as u64;
    let nth = below(rng, count) as usize;
    maze.free_cells().nth(nth).unwrap_or(maze.start())
}

//! A level: maze, start and goal, from a mode and a seed.

use crate::{
    maze::{Cell, Maze, MazeError},
    maze2d::{
        ball::{Ball, Vec2d},
        mode::Maze2dMode,
        walls::Walls,
    },
};
use playbot_learner::rng::{Streams, below, unit};
use rand::Rng;

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

/// Returns a standard normal number, by Marsaglia's polar method: the same on every machine.
pub(super) fn normal(rng: &mut impl Rng) -> f64 {
    loop {
        let [u, v] = [uniform(rng, 1.0), uniform(rng, 1.0)];
        let square = u * u + v * v;
        if square > 0.0 && square < 1.0 {
            return u * (-2.0 * libm::log(square) / square).sqrt();
        }
    }
}

/// Returns a number between `-half` and `half`.
pub(super) fn uniform(rng: &mut impl Rng, half: f64) -> f64 {
    half * (2.0 * unit(rng) - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_learner::rng::Streams;

    #[test]
    fn normal_draws_have_mean_zero_and_variance_one() {
        let mut rng = Streams::new(5).stream("n", 0);
        let draws: Vec<f64> = (0..20_000).map(|_| normal(&mut rng)).collect();
        let mean = |of: &dyn Fn(f64) -> f64| draws.iter().map(|&draw| of(draw)).sum::<f64>() / draws.len() as f64;
        assert!(mean(&|draw| draw).abs() < 0.03);
        assert!((mean(&|draw| draw * draw) - 1.0).abs() < 0.04);
        assert!((mean(&|draw| f64::from(u8::from(draw.abs() < 1.0))) - 0.6827).abs() < 0.015);
    }
}

//! A Maze2D episode without an engine: one step and its reward.

use crate::maze2d::{
    ball::{Ball, FORCE, Vec2d, length, scale, sub},
    level::Maze2dLevel,
    mode::{ContactModel, Maze2dMode},
    physics::MazePhysics,
    walls::{Walls, contact_force},
};

/// The goal is reached within this distance of its centre, m.
pub const GOAL_RADIUS: f64 = 0.5;

/// Makes one step of the ball under a push (each axis within -1..=1), with MuJoCo's contact in closed form.
pub fn step_soft(ball: &mut Ball, push: Vec2d, walls: &Walls) {
    ball.limit_speed();
    let drive = scale(push, FORCE);
    let walls_push = contact_force(ball, drive, walls);
    ball.fly([drive[0] + walls_push[0], drive[1] + walls_push[1]]);
}

/// Makes one step of the ball under a push, with rapier's contact.
pub fn step_rapier(ball: &mut Ball, push: Vec2d, physics: &mut MazePhysics) {
    ball.limit_speed();
    physics.step(ball, scale(push, FORCE));
}

/// Returns the reward of a position: exp(-distance to the goal), or with sparse rewards 1 within [`GOAL_RADIUS`] and
/// else 0.
pub fn reward(position: Vec2d, goal: Vec2d, sparse: bool) -> f32 {
    let distance = length(sub(position, goal));
    if sparse { f32::from(u8::from(distance <= GOAL_RADIUS)) } else { libm::exp(-distance) as f32 }
}

/// Returns true if the goal is reached.
pub fn is_at_goal(position: Vec2d, goal: Vec2d) -> bool {
    length(sub(position, goal)) <= GOAL_RADIUS
}

/// A ball among walls, with the arithmetic of the game, for `playbot trace` and tests.
pub struct BallSim {
    /// The ball now.
    pub ball: Ball,
    walls: Walls,
    physics: Option<MazePhysics>,
}

impl BallSim {
    /// Returns the ball of a level.
    pub fn new(mode: &Maze2dMode, level: &Maze2dLevel) -> Self {
        let mut sim = Self { ball: level.start, walls: level.walls.clone(), physics: None };
        if mode.contact == ContactModel::Rapier {
            sim.physics = Some(MazePhysics::solving(&sim.walls, &sim.ball));
        }
        sim
    }

    /// Makes one step.
    pub fn step(&mut self, push: Vec2d) {
        match &mut self.physics {
            None => step_soft(&mut self.ball, push, &self.walls),
            Some(physics) => step_rapier(&mut self.ball, push, physics),
        }
    }
}

/// Returns a fingerprint of a running episode: FNV-1a over 64-bit words, the number of steps made and the ball.
pub fn hash_state(ball: &Ball, steps: u32) -> u64 {
    let words = ball.position.iter().chain(&ball.velocity).map(|value| (value + 0.0).to_bits());
    std::iter::once(u64::from(steps))
        .chain(words)
        .fold(0xcbf2_9ce4_8422_2325, |hash, word| (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3))
}

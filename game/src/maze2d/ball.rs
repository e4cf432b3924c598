//! The ball: mass, drive, damping and free flight, as MuJoCo computes them for D4RL's point mass.
//!
//! Lengths in metres, velocities in metres per second, forces in newtons. The first axis, x, runs along the rows of the
//! map and the second, y, along its columns. All numbers are `f64`, computed with the four operations and square roots,
//! which are the same on every machine.

use std::f64::consts::PI;

/// A position, a velocity or a force: along the rows, along the columns.
pub type Vec2d = [f64; 2];

/// Seconds of one step.
pub const STEP: f64 = 0.01;

/// Radius of the ball.
pub const RADIUS: f64 = 0.1;

/// Mass of the ball, kg: that of a sphere with density 1000.
pub const MASS: f64 = 1000.0 * 4.0 / 3.0 * PI * RADIUS * RADIUS * RADIUS;

/// Force of a full push along one axis.
pub const FORCE: f64 = 100.0;

/// Damping of each axis, N s/m.
pub const DAMPING: f64 = 1.0;

/// Limit of the velocity along each axis before each step; after the step it can be larger.
pub const MAX_SPEED: f64 = 5.0;

/// Position and velocity of the ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ball {
    /// Position of the centre, m.
    pub position: Vec2d,
    /// Velocity, m/s.
    pub velocity: Vec2d,
}

/// Returns the push of an action, each axis clipped to -1..=1, and whether it was clipped.
pub fn clip_action(action: [f32; 2]) -> (Vec2d, bool) {
    let push = action.map(|value| f64::from(value.clamp(-1.0, 1.0)));
    (push, action.iter().any(|value| value.abs() > 1.0))
}

impl Ball {
    /// Returns a ball at rest.
    pub fn at(position: Vec2d) -> Self {
        Self { position, velocity: [0.0; 2] }
    }

    /// Cuts the velocity along each axis to [`MAX_SPEED`].
    pub fn limit_speed(&mut self) {
        self.velocity = self.velocity.map(|speed| speed.clamp(-MAX_SPEED, MAX_SPEED));
    }

    /// Returns the velocity after one step under a force: Euler's method with the damping taken implicitly.
    pub fn velocity_under(&self, force: Vec2d) -> Vec2d {
        let next = |axis: usize| (MASS * self.velocity[axis] + STEP * force[axis]) / (MASS + STEP * DAMPING);
        [next(0), next(1)]
    }

    /// Makes one step under a force, with nothing in the way.
    pub fn fly(&mut self, force: Vec2d) {
        self.velocity = self.velocity_under(force);
        self.position = add(self.position, scale(self.velocity, STEP));
    }
}

/// Returns the sum of two vectors.
pub(super) fn add(a: Vec2d, b: Vec2d) -> Vec2d {
    [a[0] + b[0], a[1] + b[1]]
}

/// Returns the difference of two vectors.
pub(super) fn sub(a: Vec2d, b: Vec2d) -> Vec2d {
    [a[0] - b[0], a[1] - b[1]]
}

/// Returns a vector times a number.
pub(super) fn scale(a: Vec2d, by: f64) -> Vec2d {
    [a[0] * by, a[1] * by]
}

/// Returns the scalar product.
pub(super) fn dot(a: Vec2d, b: Vec2d) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Returns the length of a vector.
pub(super) fn length(a: Vec2d) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_push_from_rest_gives_the_published_speeds() {
        let mut ball = Ball::at([1.0, 1.0]);
        let speeds: Vec<f64> = (0..5)
            .map(|_| {
                ball.fly([FORCE, 0.0]);
                ball.velocity[0]
            })
            .collect();
        for (speed, published) in speeds.iter().zip([0.238164, 0.475760, 0.712791, 0.949257, 1.185160]) {
            assert!((speed - published).abs() < 1e-6, "{speed} is not {published}");
        }
        assert!((ball.position[0] - 1.035611).abs() < 1e-6 && ball.position[1] == 1.0);
    }

    #[test]
    fn actions_are_clipped_and_said_to_be() {
        assert_eq!(clip_action([0.5, -1.0]), ([0.5, -1.0], false));
        assert_eq!(clip_action([1.5, -7.0]), ([1.0, -1.0], true));
    }
}

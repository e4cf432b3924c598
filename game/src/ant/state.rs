//! Positions and velocities of the ant, in MuJoCo's order.

use bevy_playbot::state_hash::StateHash;
use playbot_learner::rng::normal;
use rand::{Rng, RngExt};

use super::skeleton::NOMINAL_HEIGHT;

/// Number of position coordinates.
pub const POSITIONS: usize = 15;
/// Number of velocity coordinates.
pub const VELOCITIES: usize = 14;

/// Positions and velocities of the ant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AntState {
    /// Torso x, y, z in metres, its quaternion w, x, y, z, then hip 1, ankle 1 to hip 4, ankle 4 in radians.
    pub qpos: [f32; POSITIONS],
    /// Torso velocity along the world's axes in m/s, its angular velocity along its own axes in rad/s, then the joints'
    /// velocities in rad/s in the same order.
    pub qvel: [f32; VELOCITIES],
}

impl AntState {
    /// Returns the pose that episodes start around: upright in the air, legs straight, at rest.
    pub fn nominal() -> Self {
        let mut qpos = [0.0; POSITIONS];
        qpos[2] = NOMINAL_HEIGHT as f32;
        qpos[3] = 1.0;
        Self { qpos, qvel: [0.0; VELOCITIES] }
    }

    /// Returns the start of an episode: every position of the nominal pose shifted by up to 0.1 either way, velocities
    /// drawn from a normal distribution with standard deviation 0.1.
    pub fn reset(rng: &mut impl Rng) -> Self {
        let mut state = Self::nominal();
        for position in &mut state.qpos {
            *position += rng.random_range(-0.1..=0.1f32);
        }
        let length = state.qpos[3..7].iter().map(|q| q * q).sum::<f32>().sqrt();
        for q in &mut state.qpos[3..7] {
            *q /= length;
        }
        for velocity in &mut state.qvel {
            *velocity = 0.1 * normal(rng);
        }
        state
    }

    /// Returns the height of the torso's own upwards direction along the world's: 1 upright, -1 upside down.
    pub fn upright(&self) -> f32 {
        1.0 - 2.0 * (self.qpos[4] * self.qpos[4] + self.qpos[5] * self.qpos[5])
    }

    /// Returns a hash of every bit, to compare a replay with.
    pub fn hash(&self) -> StateHash {
        StateHash::of(self.qpos.iter().chain(&self.qvel).map(|value| u64::from(value.to_bits())))
    }

    /// Returns true if every number is finite.
    pub fn is_finite(&self) -> bool {
        self.qpos.iter().chain(&self.qvel).all(|value| value.is_finite())
    }
}

//! Positions and velocities of the ant, in MuJoCo's order.

use crate::ant::skeleton::{JOINTS, NOMINAL_HEIGHT};
use bevy::math::{Quat, Vec2, Vec3};
use bevy_playbot::state_hash::StateHash;
use playbot_learner::rng::normal;
use rand::{Rng, RngExt};

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

    /// Returns the start of an episode. Every position of the nominal pose is shifted by up to 0.1 either way.
    /// Velocities are drawn from a normal distribution with standard deviation 0.1.
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

// The observation of the walker.

/// Number of values.
pub const SENSES: usize = 28;

/// Returns the names of the values, in order.
pub fn names() -> Vec<String> {
    let mut names: Vec<String> = ["height", "up x", "up y", "up z"].map(String::from).into();
    names.extend(joint_names().map(|joint| format!("{joint} angle")));
    names.extend(["forwards", "leftwards", "upwards"].map(|way| format!("velocity {way}")));
    names.extend(["x", "y", "z"].map(|axis| format!("spin {axis}")));
    names.extend(joint_names().map(|joint| format!("{joint} velocity")));
    names.extend(["goal forwards", "goal leftwards"].map(String::from));
    names
}

/// Returns `hip 1`, `ankle 1`, `hip 2` and so on.
pub fn joint_names() -> [String; JOINTS] {
    std::array::from_fn(|joint| format!("{} {}", ["hip", "ankle"][joint % 2], joint / 2 + 1))
}

/// Returns the observation of an ant on its way to `goal`, in metres in the world. Body and goal are seen from the
/// torso's heading, so a gait learned in one direction works in all.
///
/// Height in metres; the world's upwards direction along the torso's axes; joint angles in radians. Then velocity in
/// m/s along the heading, to its left and upwards; angular velocity along the torso's axes in rad/s; joint velocities
/// in rad/s. Then the direction of the goal, of length 1, along the heading and to its left.
pub fn senses(state: &AntState, goal: Vec2) -> [f32; SENSES] {
    let (q, v) = (&state.qpos, &state.qvel);
    let rotation = Quat::from_xyzw(q[4], q[5], q[6], q[3]);
    let up = rotation.inverse() * Vec3::Z;
    let forwards = (rotation * Vec3::X).truncate().normalize_or(Vec2::X);
    let along = |way: Vec2| [way.dot(forwards), way.dot(forwards.perp())];
    let [ahead, left] = along(Vec2::new(v[0], v[1]));
    let towards = along((goal - Vec2::new(q[0], q[1])).normalize_or(forwards));
    let mut values = [0.0; SENSES];
    values[..4].copy_from_slice(&[q[2], up.x, up.y, up.z]);
    values[4..12].copy_from_slice(&q[7..]);
    values[12..18].copy_from_slice(&[ahead, left, v[2], v[3], v[4], v[5]]);
    values[18..26].copy_from_slice(&v[6..]);
    values[26..].copy_from_slice(&towards);
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_ant_senses_the_same() {
        let mut state = AntState::nominal();
        state.qvel[0] = 2.0;
        let ahead = senses(&state, Vec2::new(8.0, 0.0));
        let turn = Quat::from_rotation_z(1.2);
        state.qpos[3..7].copy_from_slice(&[turn.w, turn.x, turn.y, turn.z]);
        let velocity = turn * Vec3::new(2.0, 0.0, 0.0);
        state.qvel[..3].copy_from_slice(&velocity.to_array());
        let turned = senses(&state, (turn * Vec3::new(8.0, 0.0, 0.0)).truncate());
        for (a, b) in ahead.iter().zip(&turned) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
        assert_eq!(names().len(), SENSES);
        assert_eq!(ahead[26..], [1.0, 0.0]);
    }
}

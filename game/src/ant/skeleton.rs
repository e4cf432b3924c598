//! The quadruped's measures, as D4RL's ant has them, and its positions and velocities, in MuJoCo's order.
//!
//! Four legs around a ball. Each leg has three limbs: a short limb fixed to the torso, a second short limb, and a long
//! limb. The second swings about a vertical axis at the hip, the long one about a level axis at the ankle.

use bevy::math::{DMat3, DVec3, Quat, Vec2, Vec3};
use bevy_playbot::state_hash::StateHash;
use playbot_learner::rng::normal;
use rand::{Rng, RngExt};

/// Number of legs.
pub const LEGS: usize = 4;

/// Number of hinges: hip 1, ankle 1, hip 2, ankle 2, and so on.
pub const JOINTS: usize = 2 * LEGS;

/// Radius of the torso, in metres.
pub const TORSO_RADIUS: f64 = 0.25;

/// Radius of every limb, in metres.
pub const LIMB_RADIUS: f64 = 0.08;

/// Density of everything, in kg/m³.
pub const DENSITY: f64 = 5.0;

/// Height of the torso's centre in the nominal pose, in metres.
pub const NOMINAL_HEIGHT: f64 = 0.75;

/// Moment of inertia of each hinge's rotor, in kg·m². It dwarfs that of the limbs.
pub const ARMATURE: f64 = 1.0;

/// Friction of each hinge, in N·m·s.
pub const HINGE_DAMPING: f64 = 1.0;

/// Torque of an action of 1, in N·m.
pub const TORQUE: f64 = 30.0;

/// Sides of a leg along x and y.
const SIDES: [[f64; 2]; LEGS] = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];

/// Returns the vector from the torso's centre to the hip, and from the hip to the ankle of a straight leg, in metres.
pub fn short_limb(leg: usize) -> DVec3 {
    DVec3::new(0.2 * SIDES[leg][0], 0.2 * SIDES[leg][1], 0.0)
}

/// Returns the vector from the ankle to the foot of a straight leg, in metres.
pub fn long_limb(leg: usize) -> DVec3 {
    2.0 * short_limb(leg)
}

/// Axis about which a hip turns.
pub const HIP_AXIS: DVec3 = DVec3::Z;

/// Returns the axis about which an ankle turns, in the frame of the limb above it.
pub fn ankle_axis(leg: usize) -> DVec3 {
    let x = if leg.is_multiple_of(2) { -1.0 } else { 1.0 };
    DVec3::new(x, 1.0, 0.0) * std::f64::consts::FRAC_1_SQRT_2
}

/// Returns the lowest and highest angle of a joint, in radians.
pub fn joint_range(joint: usize) -> [f64; 2] {
    let degrees: [f64; 2] = match (joint % 2, joint / 2) {
        (0, _) => [-30.0, 30.0],
        (_, 0 | 3) => [30.0, 70.0],
        _ => [-70.0, -30.0],
    };
    degrees.map(f64::to_radians)
}

/// The joint that each number of an action drives: leg 4 comes first.
pub const ACTUATED: [usize; JOINTS] = [6, 7, 0, 1, 2, 3, 4, 5];

/// A solid of uniform density: its mass and its moments of inertia about its centre.
#[derive(Clone, Copy, Debug)]
pub struct Solid {
    /// Mass, in kg.
    pub mass: f64,
    /// Moment of inertia about the long axis, in kg·m².
    pub along: f64,
    /// Moment of inertia about any axis across it, in kg·m².
    pub across: f64,
}

impl Solid {
    /// Returns the torso's ball.
    pub fn torso() -> Self {
        let mass = DENSITY * 4.0 / 3.0 * std::f64::consts::PI * TORSO_RADIUS.powi(3);
        let inertia = 0.4 * mass * TORSO_RADIUS * TORSO_RADIUS;
        Self { mass, along: inertia, across: inertia }
    }

    /// Returns a limb: a cylinder of this length with half a ball at each end.
    pub fn limb(length: f64) -> Self {
        let r = LIMB_RADIUS;
        let cylinder = DENSITY * std::f64::consts::PI * r * r * length;
        let ball = DENSITY * 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        let along = cylinder * r * r / 2.0 + 0.4 * ball * r * r;
        // Half a ball has its centre of mass 3/8 r from its flat side.
        let across = cylinder * (length * length / 12.0 + r * r / 4.0)
            + ball * (0.4 * r * r + length * length / 4.0 + 3.0 / 8.0 * length * r);
        Self { mass: cylinder + ball, along, across }
    }

    /// Returns the inertia tensor about the centre, with the long axis in this direction (of length 1).
    pub fn inertia(&self, axis: DVec3) -> DMat3 {
        let outer = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        DMat3::from_diagonal(DVec3::splat(self.across)) + outer * (self.along - self.across)
    }
}

// The positions and velocities.

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

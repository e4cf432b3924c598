//! The quadruped's measures, as D4RL's ant has them.
//!
//! Four legs around a ball. Each leg has three limbs: a short limb fixed to the torso, a second short limb, and a long
//! limb. The second swings about a vertical axis at the hip, the long one about a level axis at the ankle.

use bevy::math::{DMat3, DVec3};

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

//! Mass matrix and forces without contacts: the composite rigid body algorithm and a recursive Newton-Euler pass over a
//! torso with four legs of two limbs.
//!
//! Unknowns are the accelerations of the coordinates: the torso's angular acceleration and the acceleration of its
//! centre, both along the torso's axes, and those of the hinges.

use bevy::math::DVec3;

use super::{
    arrow_matrix::{ArrowMatrix, BASE, Coordinates},
    kinematics::{Leg, Pose, Solids},
    skeleton::{ARMATURE, LEGS},
    spatial::{Inertia, Spatial},
};

/// Gravity, in m/s².
pub const GRAVITY: f64 = 9.81;

/// Returns the mass matrix of a pose, rotors included.
pub fn mass_matrix(solids: &Solids, legs: &[Leg; LEGS]) -> ArrowMatrix {
    let mut matrix = ArrowMatrix::default();
    let mut whole = solids.trunk;
    for (at, leg) in legs.iter().enumerate() {
        let both = leg.upper + leg.lower;
        whole = whole + both;
        let (by_hip, by_ankle) = (both.times(leg.hip), leg.lower.times(leg.ankle));
        matrix.arms[at] = [by_hip.to_array(), by_ankle.to_array()];
        matrix.legs[at] = [leg.hip.dot(by_hip) + ARMATURE, leg.hip.dot(by_ankle), leg.ankle.dot(by_ankle) + ARMATURE];
    }
    matrix.base = dense(&whole);
    matrix
}

fn dense(inertia: &Inertia) -> [[f64; BASE]; BASE] {
    let (t, m) = (inertia.tensor, inertia.moment);
    let mass = inertia.mass;
    [
        [t.x_axis.x, t.y_axis.x, t.z_axis.x, 0.0, -m.z, m.y],
        [t.x_axis.y, t.y_axis.y, t.z_axis.y, m.z, 0.0, -m.x],
        [t.x_axis.z, t.y_axis.z, t.z_axis.z, -m.y, m.x, 0.0],
        [0.0, m.z, -m.y, mass, 0.0, 0.0],
        [-m.z, 0.0, m.x, 0.0, mass, 0.0],
        [m.y, -m.x, 0.0, 0.0, 0.0, mass],
    ]
}

/// Forces that would hold the coordinates' velocities constant: Coriolis, centrifugal, and against gravity, in m/s².
pub fn bias(pose: &Pose, solids: &Solids, legs: &[Leg; LEGS], velocity: &Coordinates, gravity: f64) -> Coordinates {
    let base = Spatial::from_array(velocity.base);
    let up = pose.rotation.transpose() * DVec3::Z;
    // The centre's coordinates are accelerations of a point, which spatial accelerations are not: the difference is
    // ω×v.
    let start = Spatial { angular: DVec3::ZERO, linear: up * gravity - base.angular.cross(base.linear) };
    let mut total = solids.trunk.times(start) + base.carry_force(solids.trunk.times(base));
    let mut forces = Coordinates::default();
    for (at, leg) in legs.iter().enumerate() {
        let [by_hip, by_ankle] = [leg.hip * velocity.legs[at][0], leg.ankle * velocity.legs[at][1]];
        let upper = base + by_hip;
        let upper_rate = start + upper.carry_motion(by_hip);
        let lower = upper + by_ankle;
        let lower_rate = upper_rate + lower.carry_motion(by_ankle);
        let on_upper = leg.upper.times(upper_rate) + upper.carry_force(leg.upper.times(upper));
        let on_lower = leg.lower.times(lower_rate) + lower.carry_force(leg.lower.times(lower));
        let both = on_upper + on_lower;
        forces.legs[at] = [leg.hip.dot(both), leg.ankle.dot(on_lower)];
        total += both;
    }
    forces.base = total.to_array();
    forces
}

//! MuJoCo's soft constraints: joint limits and contacts with friction as one-sided springs in acceleration.
//!
//! A row J asks for J·a no less than a reference acceleration -b·(J·v) - k·d·r, where r is the violation of the
//! constraint. It pulls with weight 1/R. Stiffness k, damping b and impedance d follow from MuJoCo's `solref` and
//! `solimp`. R follows from the impedance and from the weight of the row in the nominal pose.

use bevy::math::DVec3;

use super::{
    arrow_matrix::{BASE, Coordinates, Factored},
    contact::{Contact, Limb, MARGIN},
    dynamics::mass_matrix,
    kinematics::{Pose, Solids},
    skeleton::{HIP_AXIS, LEGS, joint_range},
};

/// MuJoCo's `solref` time constant of 0.02 s, raised to two time steps as MuJoCo does, in seconds.
pub const TIME_CONSTANT: f64 = 0.04;
/// Impedance of contacts.
const CONTACT_IMPEDANCE: f64 = 0.8;
/// Impedance of joint limits, just reached and well beyond.
const LIMIT_IMPEDANCE: [f64; 2] = [0.9, 0.95];
/// Angle over which the impedance of limits rises, in radians.
const LIMIT_WIDTH: f64 = 0.001;
/// Coulomb friction of everything.
const FRICTION: f64 = 1.0;

/// A one-sided constraint.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Its part over the torso's coordinates.
    pub base: [f64; BASE],
    /// The leg whose hinges take part.
    pub leg: usize,
    /// Its part over hip and ankle.
    pub hinges: [f64; 2],
    /// Least acceleration that it asks for.
    pub reference: f64,
    /// Weight 1/R.
    pub weight: f64,
}

impl Row {
    /// Its scalar product with coordinates.
    pub fn dot(&self, x: &Coordinates) -> f64 {
        let base: f64 = self.base.iter().zip(&x.base).map(|(a, b)| a * b).sum();
        base + self.hinges[0] * x.legs[self.leg][0] + self.hinges[1] * x.legs[self.leg][1]
    }
}

/// Returns the stiffness and damping for a largest impedance.
fn spring(largest_impedance: f64) -> (f64, f64) {
    let scale = 1.0 / (largest_impedance * TIME_CONSTANT);
    (scale * scale, 2.0 * scale)
}

/// Mobility of limbs and hinges in the nominal pose: MuJoCo's `invweight0`.
#[derive(Clone, Copy, Debug)]
pub struct Mobility {
    torso: f64,
    fixed: f64,
    upper: f64,
    lower: f64,
    hinges: [f64; 2],
}

impl Mobility {
    /// Computes it for an ant with all joints at 0.
    pub fn new(solids: &Solids) -> Self {
        let pose = Pose::new(DVec3::ZERO, bevy::math::DQuat::IDENTITY, &[[0.0; 2]; LEGS]);
        let inverse = mass_matrix(solids, &pose.legs.map(|leg| solids.leg(&leg))).factor();
        let leg = &pose.legs[0];
        let mean = |limb, point| {
            let axes = [DVec3::X, DVec3::Y, DVec3::Z];
            axes.iter().map(|&axis| mobility(&inverse, &jacobian(&pose, limb, 0, point, axis))).sum::<f64>() / 3.0
        };
        let hinge = |k: usize| {
            let mut row = Coordinates::default();
            row.legs[0][k] = 1.0;
            mobility(&inverse, &row)
        };
        Self {
            torso: mean(Limb::Torso, DVec3::ZERO),
            fixed: mean(Limb::Fixed, leg.hip / 2.0),
            upper: mean(Limb::Upper, (leg.hip + leg.ankle) / 2.0),
            lower: mean(Limb::Lower, (leg.ankle + leg.foot) / 2.0),
            hinges: [hinge(0), hinge(1)],
        }
    }

    fn of(&self, limb: Limb) -> f64 {
        match limb {
            Limb::Torso => self.torso,
            Limb::Fixed => self.fixed,
            Limb::Upper => self.upper,
            Limb::Lower => self.lower,
        }
    }
}

fn mobility(inverse: &Factored, row: &Coordinates) -> f64 {
    row.dot(&inverse.solve(row))
}

/// Returns the velocity of a point of a limb along a direction, as a row over the coordinates. Both are in the torso's
/// frame.
fn jacobian(pose: &Pose, limb: Limb, leg: usize, point: DVec3, direction: DVec3) -> Coordinates {
    let turn = point.cross(direction);
    let mut row =
        Coordinates { base: [turn.x, turn.y, turn.z, direction.x, direction.y, direction.z], ..Coordinates::default() };
    let at = &pose.legs[leg];
    if matches!(limb, Limb::Upper | Limb::Lower) {
        row.legs[leg][0] = HIP_AXIS.cross(point - at.hip).dot(direction);
    }
    if limb == Limb::Lower {
        row.legs[leg][1] = at.ankle_axis.cross(point - at.ankle).dot(direction);
    }
    row
}

/// Adds a row for each joint that is beyond its limit.
pub fn limits(joints: &[[f64; 2]; LEGS], velocity: &Coordinates, mobility: &Mobility, rows: &mut Vec<Row>) {
    let (stiffness, damping) = spring(LIMIT_IMPEDANCE[1]);
    for (leg, angles) in joints.iter().enumerate() {
        for (k, &angle) in angles.iter().enumerate() {
            let [low, high] = joint_range(2 * leg + k);
            let (gap, inwards) = if angle < low {
                (angle - low, 1.0)
            } else if angle > high {
                (high - angle, -1.0)
            } else {
                continue;
            };
            let impedance = limit_impedance(-gap);
            let mut hinges = [0.0; 2];
            hinges[k] = inwards;
            rows.push(Row {
                base: [0.0; BASE],
                leg,
                hinges,
                reference: -damping * inwards * velocity.legs[leg][k] - stiffness * impedance * gap,
                weight: impedance / ((1.0 - impedance) * mobility.hinges[k]),
            });
        }
    }
}

fn limit_impedance(beyond: f64) -> f64 {
    let [least, most] = LIMIT_IMPEDANCE;
    let s = (beyond / LIMIT_WIDTH).min(1.0);
    let rise = if s <= 0.5 { 2.0 * s * s } else { 1.0 - 2.0 * (1.0 - s) * (1.0 - s) };
    least + (most - least) * rise
}

/// Adds the four edges of a contact's friction pyramid.
pub fn contact(touch: &Contact, pose: &Pose, velocity: &Coordinates, mobility: &Mobility, rows: &mut Vec<Row>) {
    let (stiffness, damping) = spring(CONTACT_IMPEDANCE);
    let into_torso = pose.rotation.transpose();
    let point = into_torso * (touch.point - pose.position);
    let row = |direction: DVec3| jacobian(pose, touch.limb, touch.leg, point, into_torso * direction);
    let normal = row(touch.normal);
    let resistance =
        (1.0 - CONTACT_IMPEDANCE) / CONTACT_IMPEDANCE * mobility.of(touch.limb) * (1.0 + FRICTION * FRICTION);
    let weight = 1.0 / (2.0 * FRICTION * FRICTION * resistance);
    for tangent in tangents(touch.normal, touch.along) {
        let tangent = row(tangent);
        for sign in [FRICTION, -FRICTION] {
            let edge = normal.plus(sign, &tangent);
            rows.push(Row {
                base: edge.base,
                leg: touch.leg,
                hinges: edge.legs[touch.leg],
                reference: -damping * edge.dot(velocity) - stiffness * CONTACT_IMPEDANCE * (touch.distance - MARGIN),
                weight,
            });
        }
    }
}

/// Returns two directions across a normal, the first as near as can be to `along`.
fn tangents(normal: DVec3, along: DVec3) -> [DVec3; 2] {
    let across = along - normal * normal.dot(along);
    let first = across.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
    [first, normal.cross(first)]
}

//! Poses of the legs, in the torso's frame.

use crate::ant::skeleton::{HIP_AXIS, LEGS, Solid, ankle_axis, long_limb, short_limb};
use bevy::math::{DMat3, DQuat, DVec3};
use std::ops::{Add, AddAssign, Mul};

/// Returns the rotation by an angle, in radians, about an axis of length 1, with the same bits on every machine.
pub fn turn(axis: DVec3, angle: f64) -> DQuat {
    let (sin, cos) = libm::sincos(angle / 2.0);
    let imaginary = axis * sin;
    DQuat::from_xyzw(imaginary.x, imaginary.y, imaginary.z, cos)
}

/// Position and orientation of one leg's moving limbs in the torso's frame.
#[derive(Clone, Copy, Debug)]
pub struct LegPose {
    /// The hip, from which the upper limb goes to the ankle's hinge.
    pub hip: DVec3,
    /// The ankle's hinge.
    pub ankle: DVec3,
    /// End of the lower limb.
    pub foot: DVec3,
    /// Orientation of the upper limb.
    pub upper: DMat3,
    /// Orientation of the lower limb.
    pub lower: DMat3,
    /// The ankle's axis.
    pub ankle_axis: DVec3,
}

impl LegPose {
    /// Returns the pose of a leg with these joint angles, in radians.
    pub fn new(leg: usize, [hip_angle, ankle_angle]: [f64; 2]) -> Self {
        let hip = short_limb(leg);
        let upper = DMat3::from_quat(turn(HIP_AXIS, hip_angle));
        let lower = upper * DMat3::from_quat(turn(ankle_axis(leg), ankle_angle));
        let ankle = hip + upper * short_limb(leg);
        let foot = ankle + lower * long_limb(leg);
        Self { hip, ankle, foot, upper, lower, ankle_axis: upper * ankle_axis(leg) }
    }
}

/// One leg's moving limbs in the torso's frame, as its dynamics need them.
#[derive(Clone, Copy, Debug)]
pub struct Leg {
    /// Inertia of the upper limb.
    pub upper: Inertia,
    /// Inertia of the lower limb.
    pub lower: Inertia,
    /// Motion of the hip at unit speed.
    pub hip: Spatial,
    /// Motion of the ankle at unit speed.
    pub ankle: Spatial,
}

/// Solids of the ant, which never change.
#[derive(Clone, Copy, Debug)]
pub struct Solids {
    /// A short limb.
    pub short: Solid,
    /// A long limb.
    pub long: Solid,
    /// The torso with the four limbs fixed to it, about the torso's centre.
    pub trunk: Inertia,
}

impl Default for Solids {
    fn default() -> Self {
        let short = Solid::limb(short_limb(0).length());
        let long = Solid::limb(long_limb(0).length());
        let torso = Solid::torso();
        let ball = Inertia::of(torso.mass, DVec3::ZERO, torso.inertia(DVec3::X));
        let trunk = (0..LEGS).fold(ball, |sum, leg| sum + limb(&short, DVec3::ZERO, short_limb(leg)));
        Self { short, long, trunk }
    }
}

impl Solids {
    /// Returns the quantities of a leg's pose that its dynamics need.
    pub fn leg(&self, pose: &LegPose) -> Leg {
        Leg {
            upper: limb(&self.short, pose.hip, pose.ankle),
            lower: limb(&self.long, pose.ankle, pose.foot),
            hip: Spatial::turn(HIP_AXIS, pose.hip),
            ankle: Spatial::turn(pose.ankle_axis, pose.ankle),
        }
    }

    /// Returns the mass of the whole ant, in kg.
    pub fn mass(&self) -> f64 {
        self.trunk.mass + LEGS as f64 * (self.short.mass + self.long.mass)
    }
}

fn limb(solid: &Solid, from: DVec3, to: DVec3) -> Inertia {
    Inertia::of(solid.mass, (from + to) / 2.0, solid.inertia((to - from).normalize()))
}

/// All quantities that follow from the joint angles and the orientation.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// The torso's centre in the world.
    pub position: DVec3,
    /// From the torso's frame to the world.
    pub rotation: DMat3,
    /// The legs in the torso's frame.
    pub legs: [LegPose; LEGS],
}

impl Pose {
    /// Computes the pose for these positions: torso in the world, orientation, and joint angles by leg.
    pub fn new(position: DVec3, orientation: DQuat, joints: &[[f64; 2]; LEGS]) -> Self {
        let legs = std::array::from_fn(|leg| LegPose::new(leg, joints[leg]));
        Self { position, rotation: DMat3::from_quat(orientation), legs }
    }

    /// Returns a point of the torso's frame in the world.
    pub fn to_world(&self, point: DVec3) -> DVec3 {
        self.position + self.rotation * point
    }
}

// Spatial vectors and inertias about the torso's centre, in the torso's axes (Featherstone, Rigid Body Dynamics
// Algorithms, 2008).

/// A motion (angular and linear velocity or acceleration) or a force (moment and force).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spatial {
    /// Angular velocity, or moment about the origin.
    pub angular: DVec3,
    /// Velocity of the origin, or force.
    pub linear: DVec3,
}

impl Spatial {
    /// Returns the motion of a turn about an axis through a point.
    pub fn turn(axis: DVec3, through: DVec3) -> Self {
        Self { angular: axis, linear: through.cross(axis) }
    }

    /// Returns the power of a force along a motion.
    pub fn dot(self, other: Self) -> f64 {
        self.angular.dot(other.angular) + self.linear.dot(other.linear)
    }

    /// Returns the rate of change of a motion that is carried along by this motion.
    pub fn carry_motion(self, motion: Self) -> Self {
        Self {
            angular: self.angular.cross(motion.angular),
            linear: self.angular.cross(motion.linear) + self.linear.cross(motion.angular),
        }
    }

    /// Returns the rate of change of a momentum that is carried along by this motion.
    pub fn carry_force(self, force: Self) -> Self {
        Self {
            angular: self.angular.cross(force.angular) + self.linear.cross(force.linear),
            linear: self.angular.cross(force.linear),
        }
    }

    /// Returns the six numbers, angular first.
    pub fn to_array(self) -> [f64; 6] {
        let (a, l) = (self.angular, self.linear);
        [a.x, a.y, a.z, l.x, l.y, l.z]
    }

    /// Returns the vector with these numbers.
    pub fn from_array(v: [f64; 6]) -> Self {
        Self { angular: DVec3::new(v[0], v[1], v[2]), linear: DVec3::new(v[3], v[4], v[5]) }
    }
}

impl Add for Spatial {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { angular: self.angular + other.angular, linear: self.linear + other.linear }
    }
}

impl AddAssign for Spatial {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul<f64> for Spatial {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self { angular: self.angular * factor, linear: self.linear * factor }
    }
}

/// Inertia of a rigid body about the origin.
#[derive(Clone, Copy, Debug)]
pub struct Inertia {
    /// Mass, in kg.
    pub mass: f64,
    /// Mass times centre of mass, in kg·m.
    pub moment: DVec3,
    /// Inertia tensor about the origin, in kg·m².
    pub tensor: DMat3,
}

impl Inertia {
    /// Takes a body with this mass and inertia about its centre of mass.
    pub fn of(mass: f64, centre: DVec3, about_centre: DMat3) -> Self {
        let outer = DMat3::from_cols(centre * centre.x, centre * centre.y, centre * centre.z);
        let steiner = (DMat3::from_diagonal(DVec3::splat(centre.length_squared())) - outer) * mass;
        Self { mass, moment: centre * mass, tensor: about_centre + steiner }
    }

    /// Returns the momentum of a motion.
    pub fn times(&self, motion: Spatial) -> Spatial {
        Spatial {
            angular: self.tensor * motion.angular + self.moment.cross(motion.linear),
            linear: motion.linear * self.mass - self.moment.cross(motion.angular),
        }
    }
}

impl Add for Inertia {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { mass: self.mass + other.mass, moment: self.moment + other.moment, tensor: self.tensor + other.tensor }
    }
}

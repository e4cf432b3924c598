//! Poses of the legs, in the torso's frame.

use bevy::math::{DMat3, DQuat, DVec3};

use super::{
    skeleton::{HIP_AXIS, LEGS, Solid, ankle_axis, long_limb, short_limb},
    spatial::{Inertia, Spatial},
};

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

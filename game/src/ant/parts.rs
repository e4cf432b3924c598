//! The ant's shapes in the world, for drawing.

use bevy::math::{DVec3, Quat, Vec3};

use super::{
    kinematics::Pose,
    skeleton::{LEGS, LIMB_RADIUS, TORSO_RADIUS},
};

/// Number of parts: the torso, and three limbs for each leg.
pub const PARTS: usize = 1 + 3 * LEGS;

/// A ball or a capsule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Centre, in metres.
    pub centre: Vec3,
    /// Turns the y axis into the direction of the capsule.
    pub rotation: Quat,
    /// Radius, in metres.
    pub radius: f32,
    /// Half the distance of a capsule's ends, in metres; 0 for a ball.
    pub half_length: f32,
}

/// Returns the torso, then fixed, upper and lower limb of each leg.
pub fn parts(pose: &Pose) -> [Part; PARTS] {
    std::array::from_fn(|part| {
        let Some(limb) = part.checked_sub(1) else {
            let turned = Quat::from_mat3(&pose.rotation.as_mat3());
            let centre = pose.position.as_vec3();
            return Part { centre, rotation: turned, radius: TORSO_RADIUS as f32, half_length: 0.0 };
        };
        let leg = &pose.legs[limb / 3];
        let (from, to) = [(DVec3::ZERO, leg.hip), (leg.hip, leg.ankle), (leg.ankle, leg.foot)][limb % 3];
        capsule(pose.to_world(from), pose.to_world(to))
    })
}

fn capsule(from: DVec3, to: DVec3) -> Part {
    let along = (to - from).as_vec3();
    Part {
        centre: ((from + to) / 2.0).as_vec3(),
        rotation: Quat::from_rotation_arc(Vec3::Y, along.normalize()),
        radius: LIMB_RADIUS as f32,
        half_length: along.length() / 2.0,
    }
}

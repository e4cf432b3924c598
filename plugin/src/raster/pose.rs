//! Poses of entities in the coordinates of their stage.

use bevy::prelude::*;

/// An affine map: three axes and the position of the origin.
///
/// Only sums and products in a fixed order, so the result is the same on every machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    pub x: Vec3,
    pub y: Vec3,
    pub z: Vec3,
    pub at: Vec3,
}

impl Pose {
    /// Returns the pose of a transform.
    pub fn of(transform: &Transform) -> Self {
        let Transform { translation: at, rotation, scale } = *transform;
        if rotation == Quat::IDENTITY {
            return Self { x: Vec3::X * scale.x, y: Vec3::Y * scale.y, z: Vec3::Z * scale.z, at };
        }
        let [i, j, k, w] = rotation.to_array();
        let double = [i + i, j + j, k + k];
        let squares = [i * double[0], j * double[1], k * double[2]];
        let mixed = [j * double[2], i * double[2], i * double[1]];
        let turned = [w * double[0], w * double[1], w * double[2]];
        Self {
            x: Vec3::new(1.0 - (squares[1] + squares[2]), mixed[2] + turned[2], mixed[1] - turned[1]) * scale.x,
            y: Vec3::new(mixed[2] - turned[2], 1.0 - (squares[0] + squares[2]), mixed[0] + turned[0]) * scale.y,
            z: Vec3::new(mixed[1] + turned[1], mixed[0] - turned[0], 1.0 - (squares[0] + squares[1])) * scale.z,
            at,
        }
    }

    /// Returns the pose of a child, or of an entity whose only parent is the stage.
    pub fn child(parent: Option<&Pose>, transform: &Transform) -> Self {
        let own = Self::of(transform);
        parent.map_or(own, |parent| parent.then(&own))
    }

    /// Returns the pose at `inner` in the coordinates of this pose.
    pub fn then(&self, inner: &Pose) -> Self {
        Self { x: self.turn(inner.x), y: self.turn(inner.y), z: self.turn(inner.z), at: self.turn(inner.at) + self.at }
    }

    fn turn(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_what_bevy_computes() {
        let outer = Transform::from_xyz(1.0, -2.0, 3.0)
            .with_rotation(Quat::from_xyzw(0.1, -0.3, 0.5, 0.7).normalize())
            .with_scale(Vec3::new(2.0, -0.5, 1.5));
        let inner = Transform::from_xyz(0.3, 0.4, -0.5)
            .with_rotation(Quat::from_xyzw(-0.4, 0.2, 0.1, 0.6).normalize())
            .with_scale(Vec3::new(0.7, 3.0, 1.0));
        let pose = Pose::child(Some(&Pose::of(&outer)), &inner);
        let affine = (GlobalTransform::from(outer) * inner).affine();
        let expected = [affine.matrix3.x_axis, affine.matrix3.y_axis, affine.matrix3.z_axis, affine.translation];
        for (got, expected) in [pose.x, pose.y, pose.z, pose.at].into_iter().zip(expected) {
            assert!((got - Vec3::from(expected)).length() < 1e-5, "{got} is not {expected}");
        }
    }
}

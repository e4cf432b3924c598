//! Observation of the walker: its body and the direction of its goal, both as seen from the torso's heading, so a gait
//! learned in one direction works in all.

use bevy::math::{Quat, Vec2, Vec3};

use super::{skeleton::JOINTS, state::AntState};

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

/// Returns the observation of an ant on its way to `goal`, in metres in the world.
///
/// Height in metres; the world's upwards direction along the torso's axes; joint angles in radians; velocity in m/s
/// along the heading, to its left and upwards; angular velocity along the torso's axes in rad/s; joint velocities in
/// rad/s; the direction of the goal, of length 1, along the heading and to its left.
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

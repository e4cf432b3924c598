//! Observation of an agent: the ant's own state, in the order of the original, without goal and walls.

use crate::ant::{AntState, sense::joint_names};

/// Returns the names of the values.
pub fn names() -> Vec<String> {
    let axes = |of: &'static str, axes: &[&'static str]| axes.iter().map(move |axis| format!("{of} {axis}")).collect();
    let joints = |what: &'static str| joint_names().iter().map(|joint| format!("{joint} {what}")).collect();
    let groups: [Vec<String>; 6] = [
        ["x", "y", "z"].map(str::to_owned).into(),
        axes("quaternion", &["w", "x", "y", "z"]),
        joints("angle"),
        axes("velocity", &["x", "y", "z"]),
        axes("spin", &["x", "y", "z"]),
        joints("velocity"),
    ];
    groups.concat()
}

/// Returns the values in the order of [`names`]: metres, a unit quaternion, radians, metres and radians per second. The
/// velocity is along the world's axes, the spin along the torso's.
pub fn values(state: &AntState) -> impl Iterator<Item = f32> {
    state.qpos.into_iter().chain(state.qvel)
}

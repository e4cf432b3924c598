//! What an agent sees: the ant's own state, in the order of the original. Neither goal nor walls are among it.

use crate::ant::AntState;

/// Names of the values.
pub const NAMES: [&str; 29] = [
    "x",
    "y",
    "z",
    "qw",
    "qx",
    "qy",
    "qz",
    "hip1",
    "ankle1",
    "hip2",
    "ankle2",
    "hip3",
    "ankle3",
    "hip4",
    "ankle4",
    "vx",
    "vy",
    "vz",
    "wx",
    "wy",
    "wz",
    "hip1_velocity",
    "ankle1_velocity",
    "hip2_velocity",
    "ankle2_velocity",
    "hip3_velocity",
    "ankle3_velocity",
    "hip4_velocity",
    "ankle4_velocity",
];

/// Names of the torques, in the order of the original: leg 4 comes first.
pub const ACTION_NAMES: [&str; 8] = ["hip4", "ankle4", "hip1", "ankle1", "hip2", "ankle2", "hip3", "ankle3"];

/// The values in the order of [`NAMES`]: metres, a unit quaternion, radians, metres and radians per second. The linear
/// velocity is the world's, the angular one the torso's.
pub fn values(state: &AntState) -> impl Iterator<Item = f32> {
    state.qpos.into_iter().chain(state.qvel)
}

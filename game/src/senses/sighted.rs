//! Direction of the goal, and distances of the walls around, as observations.

use bevy_playbot::prelude::Observation;

use super::Told;

/// Adds the direction of the goal and the distances of the walls around.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sighted;

impl Told for Sighted {
    fn names(self) -> Vec<String> {
        let goal = ["goal x", "goal y"].map(str::to_owned);
        let walls = WAYS.map(|(way, _)| format!("wall {way}"));
        goal.into_iter().chain(walls).collect()
    }
}

/// The eight directions of rays, with the components of a step of 1 m to the east and to the north: east, then on by
/// eighths of a turn to the left. North is up in the game's own picture.
pub const WAYS: [(&str, [f64; 2]); 8] = {
    const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;
    [
        ("east", [1.0, 0.0]),
        ("north-east", [DIAGONAL, DIAGONAL]),
        ("north", [0.0, 1.0]),
        ("north-west", [-DIAGONAL, DIAGONAL]),
        ("west", [-1.0, 0.0]),
        ("south-west", [-DIAGONAL, -DIAGONAL]),
        ("south", [0.0, -1.0]),
        ("south-east", [DIAGONAL, -DIAGONAL]),
    ]
};

/// Adds the goal and the rays to an observation, in the order of the names. First comes the offset of the goal along x
/// and y, then the distance of the nearest wall along each of [`WAYS`], all in metres. `wall` is called with each
/// direction, east and north.
pub fn push_rays(observation: &mut Observation, to_goal: [f32; 2], wall: impl Fn([f64; 2]) -> f32) {
    observation.vector.extend(to_goal);
    observation.vector.extend(WAYS.map(|(_, way)| wall(way)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_go_round_by_eighths_of_a_turn() {
        for (index, (name, [east, north])) in WAYS.into_iter().enumerate() {
            let angle = std::f64::consts::FRAC_PI_4 * index as f64;
            assert!((east - libm::cos(angle)).abs() < 1e-12 && (north - libm::sin(angle)).abs() < 1e-12, "{name}");
        }
    }
}

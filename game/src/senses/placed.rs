//! Telling places apart: where the agent is, in finer detail than two numbers give.

use bevy_playbot::prelude::{Observation, ObservationSpace};

use super::Told;

/// How long the waves are, in cells of the maze, which are 1 m wide in Maze2D and 4 m in AntMaze.
pub const LENGTHS: [f64; 4] = [8.0, 4.0, 2.0, 1.0];

/// Agents are told sine and cosine of their place along x and y, in [waves](Observation::waves) of [`LENGTHS`]. They say
/// nothing that x and y do not.
#[derive(Clone, Copy, Debug, Default)]
pub struct Placed;

impl Told for Placed {
    fn names(self) -> Vec<String> {
        ["x", "y"].into_iter().flat_map(|axis| ObservationSpace::wave_names(axis, LENGTHS)).collect()
    }
}

/// Adds the waves to an observation, in the order of the names. `place` is in cells, along x and y.
pub fn push_waves(observation: &mut Observation, place: [f64; 2]) {
    observation.vector.extend(place.into_iter().flat_map(|along| Observation::waves(along, LENGTHS)));
}

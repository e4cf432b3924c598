//! Positional encoding: the agent's position in finer detail than two numbers give.

use bevy_playbot::prelude::{Observation, ObservationSpace};

use super::Told;

/// Wavelengths, in cells of the maze, which are 1 m wide in Maze2D and 4 m in AntMaze.
pub const LENGTHS: [f64; 4] = [8.0, 4.0, 2.0, 1.0];

/// Adds sine and cosine of the position along x and y, as [positional encoding](Observation::waves) of [`LENGTHS`].
/// They carry no more information than x and y.
#[derive(Clone, Copy, Debug, Default)]
pub struct Placed;

impl Told for Placed {
    fn names(self) -> Vec<String> {
        ["x", "y"].into_iter().flat_map(|axis| ObservationSpace::wave_names(axis, LENGTHS)).collect()
    }
}

/// Adds the positional encoding to an observation, in the order of the names. `place` is in cells, along x and y.
pub fn push_waves(observation: &mut Observation, place: [f64; 2]) {
    observation.vector.extend(place.into_iter().flat_map(|along| Observation::waves(along, LENGTHS)));
}

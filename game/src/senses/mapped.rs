//! Map of the cells around an agent, as an observation.

use bevy_playbot::prelude::Observation;

use super::{Sighted, Told};

/// Cells of the map to each side: in a maze of 9 × 9 cells all free ones, from all but the outermost of them.
pub const REACH: i32 = 5;

/// Adds the observations of [`Sighted`], and the walls among the 11 × 11 cells around the agent.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mapped;

impl Told for Mapped {
    fn names(self) -> Vec<String> {
        let cells = around().map(|[east, north]| format!("cell {east:+} east {north:+} north"));
        Sighted.names().into_iter().chain(cells).collect()
    }
}

/// Returns the offsets of the map's cells to the east and to the north of the agent's own: rows from north to south,
/// each from west to east, as on a map.
fn around() -> impl Iterator<Item = [i32; 2]> {
    (-REACH..=REACH).rev().flat_map(|north| (-REACH..=REACH).map(move |east| [east, north]))
}

/// Adds the map to an observation: 1 for walls and for the outside, 0 for free cells. `is_wall` is called with each
/// offset to the east and to the north.
pub fn push_map(observation: &mut Observation, is_wall: impl Fn([i32; 2]) -> bool) {
    observation.vector.extend(around().map(|cell| f32::from(u8::from(is_wall(cell)))));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_read_from_the_north_west_on() {
        let mut observation = Observation::default();
        push_map(&mut observation, |[east, north]| (east, north) == (-5, 5) || (east, north) == (1, 0));
        let walls: Vec<usize> = (0..121).filter(|&at| observation.vector[at] > 0.5).collect();
        assert_eq!((observation.vector.len(), walls.as_slice()), (121, &[0, 61][..]));
        assert_eq!((&*Mapped.names()[10], &*Mapped.names()[71]), ("cell -5 east +5 north", "cell +1 east +0 north"));
    }
}

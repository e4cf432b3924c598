//! Static bodies sorted by column, so that a moving body is tested against its neighbours only.

use super::rules::Body;
use super::tile::SIZE;

/// Columns on each side of a body's own column that are searched. Two bodies of half width 0.5
/// touch when their centres are less than 1 apart, and a body moves less than 1 in a step.
const REACH: i32 = 2;

/// Static bodies with a list of neighbours for every column.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct NearBodies {
    bodies: Vec<Body>,
    /// Start of each column's neighbours in `bodies`, and the end of the last.
    starts: Vec<u32>,
}

impl NearBodies {
    /// Sorts `bodies`; each column's neighbours keep the given order.
    pub fn new(bodies: &[Body]) -> Self {
        let mut sorted = Self::default();
        for column in 0..SIZE {
            sorted.starts.push(sorted.bodies.len() as u32);
            let is_near = |body: &&Body| (body.x.floor() as i32 - column).abs() <= REACH;
            sorted.bodies.extend(bodies.iter().filter(is_near));
        }
        sorted.starts.push(sorted.bodies.len() as u32);
        sorted
    }

    /// Returns the bodies that something centred at `x` (tiles) can touch before it has moved one tile.
    #[inline]
    pub fn near(&self, x: f32) -> &[Body] {
        // `as` saturates: a position left of the level counts as column 0.
        let column = (x as usize).min(SIZE as usize - 1);
        &self.bodies[self.starts[column] as usize..self.starts[column + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_neighbours_in_order() {
        let bodies = [9, 2, 11, 12].map(|x| Body::block([x, 1]));
        let near = NearBodies::new(&bodies);
        let xs = |x: f32| near.near(x).iter().map(|b| b.x).collect::<Vec<_>>();
        assert_eq!(xs(10.2), [9.5, 11.5, 12.5]);
        assert_eq!(xs(0.0), [2.5]);
        assert_eq!(xs(-3.0), [2.5]);
        assert_eq!(xs(99.0), [] as [f32; 0]);
    }
}

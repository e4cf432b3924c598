//! The cells that an agent passes between two ticks.

use bevy::math::Vec2;

use super::grid::CellGrid;

/// Most tiles that an agent moves in a tick. An agent that is farther away was teleported, and has passed nothing.
const FARTHEST: f32 = 4.0;

/// Returns the farthest that an agent moves in a tick, for tiles of this side.
pub(crate) fn reach(tile: f32) -> f32 {
    FARTHEST * tile
}

/// Returns the cells between those of two positions, along a straight line, without the first and the last. The
/// list is empty if the positions are farther apart than `reach`. A line through a corner goes diagonally from cell to
/// cell, and touches no third one.
pub(crate) fn cells_between(grid: CellGrid, from: Vec2, to: Vec2, reach: f32) -> CellsBetween {
    let [from, to] = [from, to].map(|place| ((place - grid.origin) / grid.size).to_array());
    let at = from.map(|value| value.floor() as i32);
    let is_near = Vec2::from_array(from).distance(Vec2::from_array(to)) * grid.size <= reach;
    // NaN is not near either.
    let end = if is_near { to.map(|value| value.floor() as i32) } else { at };
    let crossing = [0_usize, 1].map(|axis| {
        let border = if to[axis] > from[axis] { from[axis].floor() + 1.0 } else { from[axis].floor() };
        (border - from[axis]) / (to[axis] - from[axis])
    });
    let each = [0_usize, 1].map(|axis| 1.0 / (to[axis] - from[axis]).abs());
    CellsBetween { at, end, crossing, each }
}

/// Column and row of each cell on a line.
pub(crate) struct CellsBetween {
    at: [i32; 2],
    end: [i32; 2],
    /// The part of the line up to the next column and the next row.
    crossing: [f32; 2],
    /// The part of the line within a column and within a row.
    each: [f32; 2],
}

impl CellsBetween {
    /// Returns where the next column or row begins; infinity for the last one.
    fn next_border(&self, axis: usize) -> f32 {
        if self.at[axis] == self.end[axis] { f32::INFINITY } else { self.crossing[axis] }
    }

    fn cross(&mut self, axis: usize) {
        self.at[axis] += (self.end[axis] - self.at[axis]).signum();
        self.crossing[axis] += self.each[axis];
    }
}

impl Iterator for CellsBetween {
    type Item = [i32; 2];

    fn next(&mut self) -> Option<[i32; 2]> {
        if self.at == self.end {
            return None;
        }
        let [column, row] = [self.next_border(0), self.next_border(1)];
        if column <= row {
            self.cross(0);
        }
        if row <= column {
            self.cross(1);
        }
        (self.at != self.end).then_some(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: CellGrid = CellGrid { origin: Vec2::new(-1.0, 0.0), size: 0.5 };

    fn between(from: [f32; 2], to: [f32; 2]) -> Vec<[i32; 2]> {
        // In cells, from the corner of the grid.
        let [from, to] = [from, to].map(|place| GRID.origin + Vec2::from_array(place) * GRID.size);
        cells_between(GRID, from, to, reach(0.5)).collect()
    }

    #[test]
    fn cells_on_the_line_are_passed_and_its_ends_are_not() {
        assert_eq!(between([0.5, 0.5], [3.5, 0.5]), [[1, 0], [2, 0]]);
        assert_eq!(between([0.5, 3.5], [0.5, 0.5]), [[0, 2], [0, 1]]);
        assert_eq!(between([2.75, 0.5], [0.5, 1.25]), [[1, 0], [1, 1]]);
        for near in [[0.5, 0.5], [0.75, 0.25], [1.5, 0.5], [0.5, -0.5]] {
            assert!(between([0.5, 0.5], near).is_empty(), "{near:?}");
        }
    }

    #[test]
    fn corners_are_no_cells() {
        assert_eq!(between([0.5, 0.5], [2.5, 2.5]), [[1, 1]]);
        assert_eq!(between([2.5, 0.5], [0.5, 2.5]), [[1, 1]]);
    }

    #[test]
    fn whoever_is_put_elsewhere_passes_nothing() {
        assert_eq!(between([0.5, 0.5], [4.5, 0.5]).len(), 3, "just as far as one can go");
        for far in [[4.75, 0.5], [90.0, 0.5], [f32::NAN, 0.5], [f32::INFINITY, 0.5]] {
            assert!(between([0.5, 0.5], far).is_empty(), "{far:?}");
        }
    }
}

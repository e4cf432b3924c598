//! The floor plan of a level, for pictures of paths and for detectors.

use bevy::math::{Rect, Vec2};

/// The shape of a level from above, or from the side, in any units: x to the right, y up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloorPlan {
    /// The area of the plan.
    pub bounds: Rect,
    /// Walls, ground and everything else that agents cannot pass.
    pub walls: Vec<Rect>,
    /// Areas that kill.
    pub hazards: Vec<Rect>,
    /// Areas that agents can stand on and walk through, such as crates.
    pub platforms: Vec<Rect>,
    /// Start of the agents.
    pub start: Vec2,
    /// Goal of the agents.
    pub goal: Vec2,
}

impl FloorPlan {
    /// Creates the plan of a level of tiles with walls only. `square` returns the area of a tile, by row and column.
    /// Adjacent walls in a row become one rectangle. There must be a tile.
    pub fn of_tiles(
        [rows, columns]: [usize; 2],
        is_wall: impl Fn(usize, usize) -> bool,
        square: impl Fn(usize, usize) -> Rect,
        [start, goal]: [Vec2; 2],
    ) -> Self {
        let walls = joined_tiles([rows, columns], is_wall, &square);
        let bounds = square(0, 0).union(square(rows - 1, columns - 1));
        Self { bounds, walls, start, goal, ..Self::default() }
    }
}

/// Returns the areas of the tiles of one kind. Adjacent tiles in a row become one rectangle.
pub fn joined_tiles(
    [rows, columns]: [usize; 2],
    is_one: impl Fn(usize, usize) -> bool,
    square: impl Fn(usize, usize) -> Rect,
) -> Vec<Rect> {
    let mut areas: Vec<Rect> = Vec::new();
    for row in 0..rows {
        let mut goes_on = false;
        for column in 0..columns {
            let is_one = is_one(row, column);
            match areas.last_mut() {
                Some(area) if is_one && goes_on => *area = area.union(square(row, column)),
                _ if is_one => areas.push(square(row, column)),
                _ => {}
            }
            goes_on = is_one;
        }
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_side_by_side_become_one() {
        let rows = ["##.#", "...."];
        let square = |row: usize, column: usize| {
            Rect::from_center_size(Vec2::new(2.0 * column as f32, 2.0 * row as f32), Vec2::splat(2.0))
        };
        let is_wall = |row: usize, column: usize| rows[row].as_bytes()[column] == b'#';
        let plan = FloorPlan::of_tiles([2, 4], is_wall, square, [Vec2::ZERO, Vec2::ONE]);
        assert_eq!(plan.walls, [Rect::new(-1.0, -1.0, 3.0, 1.0), Rect::new(5.0, -1.0, 7.0, 1.0)]);
        assert_eq!(plan.bounds, Rect::new(-1.0, -1.0, 7.0, 3.0));
    }
}

//! The inside of walls.

use bevy::math::Vec2;

use crate::{explore::CellGrid, floor_plan::FloorPlan};

/// Most tiles of a plan that are examined.
const MOST_TILES: f32 = 4e6;
/// Largest distance of a corner from the grid, in tiles.
const ROUNDING: f32 = 0.01;

/// The tiles of a level's plan that are entirely wall. Outside the plan there is no wall.
pub(super) struct SolidTiles {
    grid: CellGrid,
    columns: usize,
    rows: usize,
    is_solid: Vec<bool>,
}

impl SolidTiles {
    /// Reads the tiles of a plan; `None` for a plan without walls, and for one that is too large.
    pub fn of(plan: &FloorPlan) -> Option<Self> {
        let grid = CellGrid::new(Some(plan), None);
        let count = (plan.bounds.size() / grid.size).round();
        let is_fit = count.min_element() >= 1.0 && count.x * count.y <= MOST_TILES;
        if plan.walls.is_empty() || !is_fit {
            return None;
        }
        let (columns, rows) = (count.x as usize, count.y as usize);
        let mut is_solid = vec![false; columns * rows];
        for wall in &plan.walls {
            let first = ((wall.min - grid.origin) / grid.size - ROUNDING).ceil().max(Vec2::ZERO);
            let end = ((wall.max - grid.origin) / grid.size + ROUNDING).floor().min(count);
            let (from, to) = (first.x as usize, end.x as usize);
            for row in first.y as usize..end.y as usize {
                if from < to {
                    is_solid[row * columns + from..row * columns + to].fill(true);
                }
            }
        }
        Some(Self { grid, columns, rows, is_solid })
    }

    /// Returns whether all is wall up to this distance from a position along both axes, in tiles.
    pub fn surround(&self, place: Vec2, distance: f32) -> bool {
        let at = (place - self.grid.origin) / self.grid.size;
        let (low, high) = ((at - distance + ROUNDING).floor(), (at + distance - ROUNDING).floor());
        let is_inside = low.min_element() >= 0.0 && high.x < self.columns as f32 && high.y < self.rows as f32;
        is_inside
            && (low.y as usize..=high.y as usize)
                .all(|row| (low.x as usize..=high.x as usize).all(|column| self.is_solid[row * self.columns + column]))
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Rect;

    use super::*;

    fn plan(walls: Vec<Rect>) -> FloorPlan {
        FloorPlan { bounds: Rect::new(-1.0, -1.0, 9.0, 5.0), walls, ..FloorPlan::default() }
    }

    #[test]
    fn how_deep_a_place_is_counts_to_all_sides_and_over_walls_that_touch() {
        // Two rows of tiles of side 2, one above the other.
        let walls = vec![Rect::new(-1.0, -1.0, 7.0, 1.0), Rect::new(-1.0, 1.0, 7.0, 3.0)];
        let solid = SolidTiles::of(&plan(walls)).expect("walls");
        let middle = Vec2::new(3.0, 1.0);
        assert!(solid.surround(middle, 1.0) && !solid.surround(middle, 1.1), "two tiles thick");
        let edge = Vec2::new(6.0, 1.0);
        assert!(solid.surround(edge, 0.5) && !solid.surround(edge, 0.6));
        assert!(!solid.surround(Vec2::new(8.0, 1.0), 0.1), "in the open");
        assert!(!solid.surround(Vec2::new(-0.9, 1.0), 0.5) && !solid.surround(Vec2::NAN, 0.1), "outside is no wall");
    }

    #[test]
    fn a_plan_without_walls_or_with_far_too_many_tiles_has_none() {
        assert!(SolidTiles::of(&plan(Vec::new())).is_none());
        let bounds = Rect::new(0.0, 0.0, 1e6, 1e6);
        let vast = FloorPlan { bounds, ..plan(vec![Rect::new(0.0, 0.0, 1.0, 1.0)]) };
        assert!(SolidTiles::of(&vast).is_none());
    }
}

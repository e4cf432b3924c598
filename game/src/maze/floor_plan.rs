//! A maze as the plan that trajectories are drawn on.

use bevy::math::{Rect, Vec2};
use playbot_lab::floor_plan::FloorPlan;

use super::{cell::Cell, layout::Maze};

impl Maze {
    /// The maze from above. The game says what a cell covers and where agents stand who are at a cell, both in its own
    /// coordinates; they differ where walls are shifted against places, as in the original Maze2D.
    pub fn floor_plan(&self, square: impl Fn(Cell) -> Rect, place: impl Fn(Cell) -> Vec2) -> FloorPlan {
        FloorPlan::of_tiles(
            [self.rows(), self.columns()],
            |row, col| !self.is_free(Cell { row, col }),
            |row, col| square(Cell { row, col }),
            [place(self.start()), place(self.goal())],
        )
    }
}

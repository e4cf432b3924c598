//! Floor plan of a maze, for drawing trajectories.

use bevy::math::{Rect, Vec2};
use playbot_lab::floor_plan::FloorPlan;

use super::{cell::Cell, layout::Maze};

impl Maze {
    /// Returns the maze from above. `square` gives the area of a cell and `place` the position of agents in it, both in
    /// the game's coordinates. They differ where walls are shifted against positions, as in the original Maze2D.
    pub fn floor_plan(&self, square: impl Fn(Cell) -> Rect, place: impl Fn(Cell) -> Vec2) -> FloorPlan {
        FloorPlan::of_tiles(
            [self.rows(), self.columns()],
            |row, col| !self.is_free(Cell { row, col }),
            |row, col| square(Cell { row, col }),
            [place(self.start()), place(self.goal())],
        )
    }
}

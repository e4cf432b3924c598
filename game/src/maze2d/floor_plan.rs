//! Floor plan of a level, in the coordinates of the observation, for drawing trajectories.

use bevy::math::{Rect, Vec2};
use playbot_lab::floor_plan::FloorPlan;

use super::{
    ball::Vec2d,
    level::{Maze2dLevel, centre},
};

impl Maze2dLevel {
    /// Returns the maze with its walls as the ball meets them: x, to the right, is the row.
    pub fn floor_plan(&self) -> FloorPlan {
        let square = |cell| Rect::from_center_size(point(centre(cell)) - self.walls.offset() as f32, Vec2::ONE);
        let plan = self.maze.floor_plan(square, |cell| point(centre(cell)));
        FloorPlan { start: point(centre(self.start_cell)), goal: point(self.goal()), ..plan }
    }
}

/// Returns a position on the plan.
pub(super) fn point([x, y]: Vec2d) -> Vec2 {
    Vec2::new(x as f32, y as f32)
}

//! Floor plan of a level, in metres, for drawing trajectories.

use bevy::math::{Rect, Vec2};
use playbot_lab::floor_plan::FloorPlan;

use super::{
    geometry::{CELL, centre_of},
    level::AntMazeLevel,
};

impl AntMazeLevel {
    /// Returns the maze from above: columns go along x, to the right, and rows along y, up.
    pub fn floor_plan(&self) -> FloorPlan {
        let place = |cell| Vec2::from_array(centre_of(&self.maze, cell));
        let plan = self.maze.floor_plan(|cell| Rect::from_center_size(place(cell), Vec2::splat(CELL)), place);
        FloorPlan { start: place(self.start), goal: Vec2::from_array(self.goal_at), ..plan }
    }
}

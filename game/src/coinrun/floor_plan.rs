//! Floor plan of a level, for drawing trajectories.

use bevy::math::{Rect, Vec2};
use playbot_lab::floor_plan::{FloorPlan, joined_tiles};

use super::{Level, Spawn, rules::Body};

impl Level {
    /// Returns the used part of the level, from the side, in tiles: ground, lava and saws, crates. Enemies walk about,
    /// so they are left out.
    pub fn floor_plan(&self) -> FloorPlan {
        let [columns, rows] = self.used_size().map(|tiles| tiles.unsigned_abs() as usize);
        let square = |row: usize, column: usize| {
            let corner = Vec2::new(column as f32, row as f32);
            Rect::from_corners(corner, corner + 1.0)
        };
        let is_wall = |row: usize, column: usize| self.tiles.get(column as i32, row as i32).is_wall();
        let (player, [x, y]) = (Body::player(), self.coin);
        let ends = [Vec2::new(player.x, player.y), Vec2::new(x as f32 + 0.5, y as f32 + 0.5)];
        let is_lava = |row: usize, column: usize| self.tiles.get(column as i32, row as i32).is_lava();
        let at = |[x, y]: [i32; 2]| square(y as usize, x as usize);
        let mut hazards = joined_tiles([rows, columns], is_lava, square);
        let mut platforms = Vec::new();
        for spawn in self.spawns.iter().copied() {
            match spawn {
                Spawn::Saw(cell) => hazards.push(at(cell)),
                Spawn::Crate { cell, .. } => platforms.push(at(cell)),
                Spawn::Enemy { .. } => {}
            }
        }
        FloorPlan { hazards, platforms, ..FloorPlan::of_tiles([rows, columns], is_wall, square, ends) }
    }
}

//! Arenas as stages with floor and walls.

use bevy::prelude::*;
use bevy_playbot::vision::{Stage, TileLayer};

use super::{
    GROUND,
    art::{Art, FLOOR, WALL},
};
use crate::antview::Ground;

/// From the corner of one arena to the corner of the next, metres. Cameras see several arenas where mazes have more than
/// 120 cells to the side; sensors that draw by themselves never do.
const SPACING: f32 = 512.0;
/// Arenas side by side.
const ARENAS_PER_ROW: u32 = 8;

/// Number of arenas that have got a place.
#[derive(Resource, Default)]
pub struct Stages(u32);

/// The tiles of an arena.
#[derive(Component)]
pub struct Tiling(Entity);

/// Makes new arenas into stages.
pub fn stages(new: Query<Entity, (With<Ground>, Without<Tiling>)>, mut stages: ResMut<Stages>, mut commands: Commands) {
    for arena in &new {
        let (column, row) = (stages.0 % ARENAS_PER_ROW, stages.0 / ARENAS_PER_ROW);
        stages.0 += 1;
        let place = Vec3::new(column as f32, row as f32, 0.0) * SPACING;
        let tiling = commands.spawn((ChildOf(arena), Transform::default())).id();
        commands.entity(arena).insert((Stage, Transform::from_translation(place), Tiling(tiling)));
    }
}

/// Lays the tiles of new grounds.
pub fn tiles(
    changed: Query<(&Ground, &Tiling), Or<(Changed<Ground>, Added<Tiling>)>>,
    art: Res<Art>,
    mut commands: Commands,
) {
    for (ground, tiling) in &changed {
        let number = |is_wall| if is_wall { WALL } else { FLOOR };
        let layer = TileLayer {
            tileset: art.tiles.clone(),
            columns: ground.columns,
            rows: ground.is_wall.len() as u32 / ground.columns.max(1),
            cells: ground.is_wall.iter().map(|&is_wall| number(is_wall)).collect(),
            outside: number(ground.walled),
        };
        let [x, y] = ground.corner;
        let place = Transform::from_xyz(x, y, GROUND).with_scale(Vec3::new(ground.cell, ground.cell, 1.0));
        commands.entity(tiling.0).insert((layer, place));
    }
}

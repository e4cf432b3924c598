//! Arenas as stages with floor and walls.

use bevy::prelude::*;
use bevy_playbot::vision::{Stage, TileLayer};

use super::{
    art::{Art, FLOOR, WALL},
    layers::GROUND,
};
use crate::{
    ant::view::{AntPose, Ground, OnGround},
    arena_grid::ArenaGrid,
};

/// Distance from the corner of one arena to the corner of the next, metres. Cameras see several arenas where mazes have
/// more than 120 cells to the side; sensors that draw by themselves never do.
const SPACING: f32 = 512.0;

/// The tiles of an arena.
#[derive(Component, Reflect)]
#[reflect(Component)]
pub struct Tiling(Entity);

/// Makes new arenas into stages.
pub fn stages(
    new: Query<Entity, (With<Ground>, Without<Tiling>)>,
    mut grid: ResMut<ArenaGrid>,
    mut commands: Commands,
) {
    for arena in &new {
        let tiling = commands.spawn((ChildOf(arena), Transform::default())).id();
        commands.entity(arena).insert((Stage, grid.next(SPACING), Tiling(tiling)));
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

/// Keeps the origin of an open floor's tiles within half a cell of its ant. All tiles are alike, so the moves are
/// invisible, and the floor has no visible edge.
pub fn follow(
    ants: Query<(&AntPose, &OnGround)>,
    grounds: Query<(&Ground, &Tiling)>,
    mut tilings: Query<&mut Transform, With<TileLayer>>,
) {
    for (pose, on_ground) in &ants {
        let Ok((ground, tiling)) = grounds.get(on_ground.0) else { continue };
        let Ok(mut place) = tilings.get_mut(tiling.0) else { continue };
        if !ground.is_wall.is_empty() {
            continue;
        }
        let corner = Vec2::from(ground.corner);
        let cells = ((pose.0[0].centre.truncate() - corner) / ground.cell).round();
        let at = (corner + cells * ground.cell).extend(GROUND);
        if place.translation != at {
            place.translation = at;
        }
    }
}

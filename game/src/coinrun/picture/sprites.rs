//! Creation of sprites and tiles for arenas and their inhabitants.

use bevy::{prelude::*, sprite::Anchor};
use bevy_playbot::vision::{PaintedVelocity, Stage, TileLayer};

use super::{
    art::{Art, Pose},
    scenery::{ACTORS, BACKDROP, BLOCKS, GROUND, PLAYER_HEIGHT, STEP, Scenery},
    trail::Trail,
};
use crate::{
    arena_grid::ArenaGrid,
    coinrun::{
        components::{Arena, ArenaBody, ArenaEntities, Crate, Enemy, InArena, PlayerBody, PlaysIn, Saw, Tiles},
        tile::{SIZE, TileGrid},
    },
};

/// Distance from the corner of one arena to the corner of the next: further than any view over the border of a level.
const SPACING: f32 = 96.0;

/// Makes the arenas of new players into stages, and the players into sprites.
pub(super) fn players(
    new: Query<(Entity, &PlaysIn), (With<PlayerBody>, Without<Sprite>)>,
    art: Res<Art>,
    mut grid: ResMut<ArenaGrid>,
    mut commands: Commands,
) {
    for (player, plays_in) in &new {
        let backdrop = commands.spawn(ChildOf(plays_in.0)).id();
        let ground = commands.spawn((ChildOf(plays_in.0), Transform::from_xyz(0.0, 0.0, GROUND))).id();
        let scenery = Scenery { backdrop, ground, placed: 0, tick: 0 };
        commands.entity(plays_in.0).insert((Stage, grid.next(SPACING), scenery));
        let sprite = Sprite { rect: Some(Art::player(0, Pose::Stand)), ..Sprite::from_image(art.figures.clone()) };
        // The camera is on the middle of the body; the picture stands on the body's feet.
        let feet = Anchor(Vec2::new(0.0, 0.5 / PLAYER_HEIGHT - 0.5));
        let place = Transform::from_xyz(0.0, 0.0, ACTORS);
        commands.entity(player).insert((ChildOf(plays_in.0), sprite, feet, place, PaintedVelocity::default()));
    }
}

/// Puts the tiles and the backdrop of new levels into their arenas.
pub(super) fn levels(
    mut changed: Query<(&Arena, &Tiles, &mut Scenery), Or<(Changed<Arena>, Changed<Tiles>, Added<Scenery>)>>,
    mut layers: Query<&mut TileLayer>,
    art: Res<Art>,
    mut commands: Commands,
) {
    for (arena, tiles, mut scenery) in &mut changed {
        let (level, size) = (&arena.level, SIZE as f32);
        scenery.placed = 0;
        commands.entity(scenery.backdrop).insert((
            Sprite {
                custom_size: Some(Vec2::splat(size)),
                rect: Some(Art::backdrop_part(level.background_offset, size)),
                ..Sprite::from_image(art.backdrop(level.background))
            },
            Transform::from_xyz(size / 2.0, size / 2.0, BACKDROP),
        ));
        let tileset = art.ground(level.ground_theme);
        match layers.get_mut(scenery.ground) {
            Ok(mut layer) => {
                layer.tileset = tileset;
                layer.cells.clear();
                layer.cells.extend(cells(&tiles.0));
            }
            Err(_) => {
                let (side, outside) = (SIZE as u32, 0);
                let layer = TileLayer { tileset, columns: side, rows: side, cells: cells(&tiles.0).collect(), outside };
                commands.entity(scenery.ground).insert(layer);
            }
        }
    }
}

/// Returns the tile numbers of all cells, bottom row first.
fn cells(tiles: &TileGrid) -> impl Iterator<Item = u16> {
    tiles.iter().map(|tile| Art::tile(tile).unwrap_or(TileLayer::EMPTY))
}

/// Makes sprites of new saws, crates and enemies.
pub(super) fn entities(
    mut arenas: Query<(&ArenaEntities, &mut Scenery), Changed<ArenaEntities>>,
    new: Query<
        (&InArena, &ArenaBody, Option<&Crate>, Option<&Enemy>),
        (Or<(With<Saw>, With<Crate>, With<Enemy>)>, Without<Sprite>),
    >,
    art: Res<Art>,
    mut commands: Commands,
) {
    for (entities, mut scenery) in &mut arenas {
        for entity in entities.iter() {
            let Ok((in_arena, body, wooden, enemy)) = new.get(entity) else { continue };
            let (rect, layer) = match (wooden, enemy) {
                (_, Some(enemy)) => (Art::enemy(enemy.sprite, 0), ACTORS),
                (Some(wooden), _) => (Art::wooden_crate(wooden.sprite), BLOCKS),
                (None, None) => (Art::saw(0), BLOCKS),
            };
            scenery.placed += 1;
            let size = Vec2::new(2.0 * body.0.rx, 2.0 * body.0.ry);
            commands.entity(entity).insert((
                ChildOf(in_arena.0),
                Sprite { rect: Some(rect), custom_size: Some(size), ..Sprite::from_image(art.figures.clone()) },
                Transform::from_xyz(body.0.x, body.0.y, layer + scenery.placed as f32 * STEP),
            ));
            if enemy.is_some() {
                commands.entity(entity).insert(Trail::new(scenery.placed));
            }
        }
    }
}

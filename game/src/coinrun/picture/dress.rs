//! Gives arenas and everything in them what is drawn.

use bevy::{prelude::*, sprite::Anchor};
use bevy_playbot::vision::{PaintedVelocity, Stage, TileLayer};

use super::{
    animate::PLAYER_HEIGHT,
    art::{Art, Pose},
    trail::Trail,
};
use crate::coinrun::{
    SIZE, TileGrid,
    components::{Arena, ArenaBody, Crate, Enemy, InArena, Inhabitants, PlayerBody, PlaysIn, Saw, Tiles},
};

/// Layers, the farthest first. Things of one layer lie [`STEP`] apart in the order in which they were made.
const BACKDROP: f32 = -2.0;
const GROUND: f32 = -1.0;
pub(super) const BLOCKS: f32 = 0.0;
const ACTORS: f32 = 1.0;
const STEP: f32 = 1.0 / 1024.0;

/// From the corner of one arena to the corner of the next: further than anybody sees over the border of a level.
const SPACING: f32 = 96.0;
/// Arenas side by side.
const ARENAS_PER_ROW: u32 = 8;

/// Number of arenas that have got a place.
#[derive(Resource, Default)]
pub(super) struct Stages(u32);

/// What belongs to the picture of an arena, and the tick that it shows.
#[derive(Component)]
pub(super) struct Scenery {
    backdrop: Entity,
    ground: Entity,
    /// Number of bodies that have been given a place in front of one another.
    dressed: u32,
    /// Tick of the episode.
    pub tick: u32,
}

/// Makes the arenas of new players into stages, and the players into sprites.
pub(super) fn players(
    new: Query<(Entity, &PlaysIn), (With<PlayerBody>, Without<Sprite>)>,
    art: Res<Art>,
    mut stages: ResMut<Stages>,
    mut commands: Commands,
) {
    for (player, plays_in) in &new {
        let (column, row) = (stages.0 % ARENAS_PER_ROW, stages.0 / ARENAS_PER_ROW);
        stages.0 += 1;
        let place = Vec3::new(column as f32, row as f32, 0.0) * SPACING;
        let backdrop = commands.spawn(ChildOf(plays_in.0)).id();
        let ground = commands.spawn((ChildOf(plays_in.0), Transform::from_xyz(0.0, 0.0, GROUND))).id();
        let scenery = Scenery { backdrop, ground, dressed: 0, tick: 0 };
        commands.entity(plays_in.0).insert((Stage, Transform::from_translation(place), scenery));
        let sprite = Sprite { rect: Some(Art::player(0, Pose::Stand)), ..Sprite::from_image(art.figures.clone()) };
        // The eye is on the middle of the body; the picture stands on the body's feet.
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
        scenery.dressed = 0;
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

/// Tile numbers of all cells, bottom row first.
fn cells(tiles: &TileGrid) -> impl Iterator<Item = u16> {
    tiles.iter().map(|tile| Art::tile(tile).unwrap_or(TileLayer::EMPTY))
}

/// Makes sprites of new saws, crates and enemies.
pub(super) fn inhabitants(
    mut arenas: Query<(&Inhabitants, &mut Scenery), Changed<Inhabitants>>,
    undressed: Query<
        (&InArena, &ArenaBody, Option<&Crate>, Option<&Enemy>),
        (Or<(With<Saw>, With<Crate>, With<Enemy>)>, Without<Sprite>),
    >,
    art: Res<Art>,
    mut commands: Commands,
) {
    for (inhabitants, mut scenery) in &mut arenas {
        for entity in inhabitants.iter() {
            let Ok((in_arena, body, wooden, enemy)) = undressed.get(entity) else { continue };
            let (rect, layer) = match (wooden, enemy) {
                (_, Some(enemy)) => (Art::enemy(enemy.sprite, 0), ACTORS),
                (Some(wooden), _) => (Art::wooden_crate(wooden.sprite), BLOCKS),
                (None, None) => (Art::saw(0), BLOCKS),
            };
            scenery.dressed += 1;
            let size = Vec2::new(2.0 * body.0.rx, 2.0 * body.0.ry);
            commands.entity(entity).insert((
                ChildOf(in_arena.0),
                Sprite { rect: Some(rect), custom_size: Some(size), ..Sprite::from_image(art.figures.clone()) },
                Transform::from_xyz(body.0.x, body.0.y, layer + scenery.dressed as f32 * STEP),
            ));
            if enemy.is_some() {
                commands.entity(entity).insert(Trail::new(scenery.dressed));
            }
        }
    }
}

//! The look of CoinRun: Procgen's picture, with drawings of our own.
//!
//! Each arena becomes a [`Stage`] with a backdrop, its tiles and a sprite for every inhabitant, in the arena's own
//! coordinates. One unit is one tile. Nothing here changes the game. The picture follows from the episode alone:
//! animations count its ticks, and enemies leave puffs behind.
//!
//! The folder, in reading order:
//!
//! - `art`: the drawings, those of puffs among them, and the positions of figures on them.
//! - `animate`: updates of sprites: positions, poses, directions.

mod animate;
mod art;

use crate::{
    coinrun::{
        components::{Arena, ArenaBody, ArenaEntities, Crate, Enemy, InArena, PlayerBody, PlaysIn, Saw, Tiles},
        picture::animate::Trail,
        tile::{SIZE, TileGrid},
    },
    pictures::ArenaGrid,
};
use bevy::{prelude::*, sprite::Anchor};
use bevy_playbot::vision::{PaintedVelocity, Stage, TileLayer, VisionSystems};
use playbot_harness::prelude::*;

pub use crate::coinrun::picture::art::{Art, Pose};

/// Adds sprites and tiles to [`CoinRunPlugin`](crate::coinrun::CoinRunPlugin). Add it after the plugins that bring
/// images, such as Bevy's own or a sensor's.
#[derive(Clone, Copy, Debug, Default)]
pub struct CoinRunPicturePlugin;

impl Plugin for CoinRunPicturePlugin {
    fn build(&self, app: &mut App) {
        let mut images = app.world_mut().get_resource_or_init::<Assets<Image>>();
        let art = Art::add_to(&mut images);
        app.insert_resource(art).init_resource::<ArenaGrid>().add_systems(
            ObserveSchedule,
            (
                players,
                levels,
                entities,
                animate::players,
                animate::enemies,
                animate::saws,
                animate::moved_blocks,
                animate::trails,
            )
                .chain()
                .in_set(VisionSystems::Sync),
        );
    }
}

/// Tiles from the left to the right edge of an agent's view.
pub const VIEW: f32 = 13.0;

// Parts of an arena's picture, and the order of its layers.

/// Layers, the farthest first. Entities of one layer lie [`STEP`] apart in creation order.
pub(crate) const BACKDROP: f32 = -2.0;

pub(crate) const GROUND: f32 = -1.0;

pub(crate) const BLOCKS: f32 = 0.0;

pub(crate) const ACTORS: f32 = 1.0;

pub(crate) const STEP: f32 = 1.0 / 1024.0;

/// Height of a player's picture in heights of its body; its feet are at the body's.
pub(crate) const PLAYER_HEIGHT: f32 = 1.7415;

/// Marks parts of an arena's picture, with the tick that it shows.
#[derive(Component, Reflect)]
#[reflect(Component)]
pub struct Scenery {
    /// The picture behind everything.
    pub backdrop: Entity,
    /// The layer of tiles.
    pub ground: Entity,
    /// Number of bodies that have a depth.
    pub placed: u32,
    /// Tick of the episode.
    pub tick: u32,
}

// Creation of sprites and tiles for arenas and their inhabitants.

/// Distance from the corner of one arena to the corner of the next: further than any view over the border of a level.
const SPACING: f32 = 96.0;

/// Makes the arenas of new players into stages, and the players into sprites.
fn players(
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
fn levels(
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
fn entities(
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

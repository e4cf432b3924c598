//! Defects of hazards: harmless ones, and deaths without one.

use bevy::prelude::*;
use playbot_lab::{defect::DefectKind, prelude::*};

use super::{cells::while_played, way::begins};
use crate::{
    coinrun::{
        components::{Arena, ArenaBody, ArenaEntities, Enemy, InArena, PlayerBody, PlaysIn, Saw, Tiles},
        rules::{BLOCK_HALF, Body},
        systems::CoinRunSystems,
        tile::{SIZE, Tile, TileGrid},
    },
    defect_variant::{PLACES, pick, variants},
};

/// Distance from a hazard at which a player dies, tiles.
const FAR: [f32; 2] = [0.75, 2.0];
/// Distance by which an enemy leaves its lane in each tick, tiles upwards.
const STRAY: [f32; 2] = [0.05, -0.05];

pub(super) fn defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules("harmless-hazard", "saws, enemies and lava do not kill", PLACES, |app, variant| {
            harmless(app, variant);
        }),
        DefectKind::rules(
            "far-hazard",
            "saws, enemies and lava kill from afar",
            variants(FAR.len()),
            |app, variant| {
                far(app, variant, pick(&FAR, variant));
            },
        ),
        DefectKind::rules("stray-enemy", "enemies leave their lanes", variants(STRAY.len()), |app, variant| {
            stray(app, variant, pick(&STRAY, variant));
        }),
    ]
}

type Hazard = Or<(With<Saw>, With<Enemy>)>;

/// Makes hazards harmless. While the rules look, bodies have a half width of minus that of a player, so no player
/// overlaps them. Enemies walk as ever, since their corners are in the same two columns.
fn harmless(app: &mut App, variant: u32) {
    let shrink = move |mut bodies: Query<(&mut ArenaBody, &InArena), Hazard>, arenas: Query<&Arena>| {
        for (mut body, in_arena) in &mut bodies {
            let is_far_enough = |arena: &Arena| body.0.x >= begins(&arena.level, variant);
            if arenas.get(in_arena.0).is_ok_and(is_far_enough) {
                body.bypass_change_detection().0.rx = -BLOCK_HALF;
            }
        }
    };
    let grow = |mut bodies: Query<&mut ArenaBody, Hazard>| {
        for mut body in &mut bodies {
            body.bypass_change_detection().0.rx = BLOCK_HALF;
        }
    };
    app.add_systems(FixedUpdate, (shrink.before(CoinRunSystems), grow.after(CoinRunSystems)));
    while_played(app, move |level, _| {
        let cells = (begins(level, variant).ceil() as i32..SIZE).flat_map(|x| (0..SIZE).map(move |y| [x, y]));
        let lava = cells.filter(|&[x, y]| level.tiles.get(x, y).is_lava());
        lava.map(|cell| (cell, Tile::Empty)).collect()
    });
}

/// Ends the episode of a player that comes near.
fn far(app: &mut App, variant: u32, reach: f32) {
    let kill = move |mut players: Query<(&Control, &mut Episode, &PlaysIn, &PlayerBody)>,
                     arenas: Query<(&Arena, &Tiles, &ArenaEntities)>,
                     hazards: Query<&ArenaBody, Hazard>| {
        for (control, mut episode, plays_in, player) in &mut players {
            let Ok((arena, tiles, entities)) = arenas.get(plays_in.0) else { continue };
            let plays = control.is_active() && episode.is_running() && episode.end().is_none();
            if !plays || player.0.x < begins(&arena.level, variant) {
                continue;
            }
            let is_near = |entity| hazards.get(entity).is_ok_and(|body| body.0.overlaps(&player.0, reach));
            if entities.iter().any(is_near) || is_near_lava(&tiles.0, &player.0, reach) {
                episode.terminate(false);
            }
        }
    };
    app.add_systems(FixedPostUpdate, kill.before(PlaybotSystems::Judge));
}

fn is_near_lava(tiles: &TileGrid, player: &Body, reach: f32) -> bool {
    let cells =
        |centre: f32, half: f32| (centre - half - reach).floor() as i32..=(centre + half + reach).floor() as i32;
    cells(player.x, player.rx).any(|x| cells(player.y, player.ry).any(|y| tiles.get(x, y).is_lava()))
}

/// Lifts or sinks enemies during play.
fn stray(app: &mut App, variant: u32, by: f32) {
    let lift = move |mut enemies: Query<(&mut ArenaBody, &InArena), With<Enemy>>,
                     arenas: Query<&Arena>,
                     players: Query<(&Control, &Episode)>| {
        for (mut body, in_arena) in &mut enemies {
            let Ok(arena) = arenas.get(in_arena.0) else { continue };
            let plays = |(control, episode): (&Control, &Episode)| control.is_active() && episode.is_running();
            if body.0.x >= begins(&arena.level, variant) && players.get(arena.player).is_ok_and(plays) {
                body.0.y += by;
            }
        }
    };
    app.add_systems(FixedPostUpdate, lift.before(PlaybotSystems::Judge));
}

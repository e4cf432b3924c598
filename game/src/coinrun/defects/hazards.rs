//! Defects of hazards, harmless ones and deaths without one, and levels with missing ground or a trap.

use crate::coinrun::{
    components::{Arena, ArenaBody, ArenaEntities, Enemy, InArena, PlayerBody, PlaysIn, Saw, Tiles},
    defects::{between, dig, fill, of_levels, summit, surface, walls::begins, while_played},
    level::{LevelParts, Spawn},
    play::CoinRunSystems,
    rules::{BLOCK_HALF, Body},
    tile::{SIZE, Tile, TileGrid},
};
use bevy::prelude::*;
use playbot_harness::{
    defect::{DefectKind, PLACES, pick, variants},
    prelude::*,
};
use playbot_learner::rng::{ChaCha8Rng, below};

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

// Levels with missing ground.

pub(super) fn pit_defects() -> Vec<DefectKind> {
    vec![
        of_levels("wide-pit", "a pit on the only path is wider than any jump", wide_pit),
        of_levels("missing-floor", "the ground of the start or of the path's end is missing", missing_floor),
    ]
}

/// Returns the width of a pit that no jump crosses. A jump is back at its height after 16 ticks. From there it falls by
/// 1.5 tiles in each, and by no more than the highest ground. A tick moves half a tile. Half a player hangs over on
/// either side, and the rest is spare.
fn too_wide(parts: &LevelParts) -> i32 {
    8 + summit(parts) / 3 + 5
}

fn wide_pit(parts: &mut LevelParts, rng: &mut ChaCha8Rng) -> Option<()> {
    let width = too_wide(parts);
    let left = between(rng, 4, parts.coin[0] - width - 1)?;
    dig(parts, left, width);
    Some(())
}

/// Removes the floor, in one of two places. Under the start, the first tick then ends in the lava. From some column up
/// to the coin, the coin then hangs farther away than a jump leads.
fn missing_floor(parts: &mut LevelParts, rng: &mut ChaCha8Rng) -> Option<()> {
    let [x, y] = parts.coin;
    let wanted = below(rng, 2);
    match between(rng, 4, x - too_wide(parts)).filter(|_| wanted == 0) {
        Some(left) => {
            dig(parts, left, x - left + 1);
            parts.tiles.set(x, y, Tile::Coin);
        }
        None => {
            let width = between(rng, 3, (x - 3).min(6))?;
            dig(parts, 1, width);
        }
    }
    Some(())
}

// A trap: a pit without a path out.

/// A step up, and the height of a tower: one jump leads up a step, none up a tower. A jump lifts by 6.4 tiles.
const STEP: i32 = 4;

const TOWER: i32 = 8;

/// Columns of a step, of a tower, and between the towers.
const WIDE: i32 = 2;

const GAP: i32 = 3;

/// All columns.
const WIDTH: i32 = 4 * WIDE + GAP;

pub(super) fn trap_defects() -> Vec<DefectKind> {
    vec![of_levels("one-way-trap", "a player that falls between two towers never gets out", one_way_trap)]
}

/// Builds two towers with steps on their outer sides only. Players can climb and jump over them. Between them nothing
/// kills, and no jump leads out.
fn one_way_trap(parts: &mut LevelParts, rng: &mut ChaCha8Rng) -> Option<()> {
    let places: Vec<i32> = (6..parts.coin[0] - WIDTH - 1).filter(|&x| is_place(parts, x)).collect();
    let left = *places.get(below(rng, places.len().max(1) as u64) as usize)?;
    let ground = surface(parts, left - 1);
    let heights = [(WIDE, STEP), (WIDE, TOWER), (GAP, 0), (WIDE, TOWER), (WIDE, STEP)];
    let mut x = left;
    for (width, height) in heights {
        block(parts, x, width, ground + height);
        x += width;
    }
    Some(())
}

/// Returns true if there is ground on both sides, the far one not too high, and no hazard at its edges.
fn is_place(parts: &LevelParts, left: i32) -> bool {
    let right = left + WIDTH;
    let (near, far) = (surface(parts, left - 1), surface(parts, right));
    let is_calm = |x: i32| {
        let on_ground = !parts.tiles.get(x, surface(parts, x)).is_lava();
        on_ground && !parts.spawns.iter().any(|spawn| !matches!(spawn, Spawn::Crate { .. }) && spawn.cell()[0] == x)
    };
    // Row 1 is the bottom of pits.
    near > 1
        && far > 1
        && surface(parts, left - 2) == near
        && far - near <= TOWER
        && [left - 2, left - 1, right].into_iter().all(is_calm)
        && near + TOWER < SIZE - 12
}

/// Builds ground up to a height, and nothing above.
fn block(parts: &mut LevelParts, x: i32, width: i32, height: i32) {
    fill(parts, [x, 0], [width, height - 1], Tile::Wall);
    fill(parts, [x, height - 1], [width, 1], Tile::WallTop);
    fill(parts, [x, height], [width, SIZE - 1 - height], Tile::Empty);
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use playbot_learner::rng::Streams;

    use super::*;
    use crate::coinrun::{
        Mode, Plan, PlannerConfig, Sim,
        generator::generate,
        level::Level,
        planner::plan,
        rules::{Body, PlayerState},
    };

    #[test]
    fn a_player_in_the_trap_stays_there_and_others_get_past() {
        let mut past = 0;
        for seed in 0..30 {
            let mut parts = generate(Mode::Hard, seed).parts().clone();
            let mut rng = Streams::new(u64::from(seed)).stream("trap", 0);
            if one_way_trap(&mut parts, &mut rng).is_none() {
                continue;
            }
            let level = Arc::new(Level::new(parts));
            past += u32::from(matches!(plan(&Sim::new(level.clone()), &PlannerConfig::default()), Plan::Found(_)));
            // The gap is the only place of three columns of one height between two that are eight higher.
            let height = |x: i32| surface(&level, x);
            let gap = (6..SIZE - 4).find(|&x| {
                (x..x + GAP).all(|column| height(column) == height(x))
                    && (height(x - 3), height(x - 1)) == (height(x) + STEP, height(x) + TOWER)
                    && height(x + GAP) == height(x) + TOWER
            });
            let gap = gap.expect("there is one");
            let low = height(gap) as f32;
            let start = Body::player();
            let player = Body { x: gap as f32 + 1.5, y: low + start.ry, ..start };
            let mut sim = Sim::resume(level.clone(), player, PlayerState::default(), Vec::new(), 0);
            for step in 0..600_u32 {
                // To one side and to the other, hopping all the time.
                sim.step(if step / 60 % 2 == 0 { 8 } else { 2 });
                assert!(sim.end().is_none() && (sim.x() - gap as f32 - 1.5).abs() < 1.1, "{seed}: {}", sim.x());
            }
        }
        assert!(past >= 3, "{past} levels can still be solved");
    }
}

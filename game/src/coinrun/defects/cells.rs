//! Defects of cells that the rules see differently from the pictures and observations.

use bevy::prelude::*;
use playbot_lab::defect::DefectKind;

use super::{edit::surface, way::column};
use crate::{
    coinrun::{
        components::{Arena, PlayerBody, Tiles},
        level::Level,
        rules::Body,
        systems::CoinRunSystems,
        tile::{SIZE, Tile},
    },
    defect_variant::{PLACES, pick, variants},
};

/// Height of an invisible wall, rows above the ground: as high as the level, and low enough for a jump.
const HEIGHTS: [i32; 2] = [SIZE, 4];
/// Columns of ground that do not hold.
const HOLES: [i32; 2] = [2, 4];
/// Speed along the path from which on a player runs, tiles per tick.
const RUNS: f32 = 0.3;

/// A cell and its tile in the rules.
type Cell = ([i32; 2], Tile);

pub(super) fn defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules("invisible-wall", "an empty cell blocks players", variants(HEIGHTS.len()), |app, variant| {
            let height = pick(&HEIGHTS, variant);
            while_played(app, move |level, _| invisible_wall(level, column(level, variant), height));
        }),
        DefectKind::rules("missing-collider", "ground does not hold", variants(HOLES.len()), |app, variant| {
            let width = pick(&HOLES, variant);
            while_played(app, move |level, _| missing_ground(level, column(level, variant), width));
        }),
        // Its place is always the same, the coin: variants differ in the players that do not get it.
        DefectKind::rules("goal-does-not-end", "the coin can be touched and is not taken", PLACES, |app, variant| {
            while_played(app, move |level, player| {
                let is_missed = match variant {
                    0 => true,
                    1 => player.vy != 0.0,
                    _ => player.vx.abs() > RUNS,
                };
                is_missed.then_some((level.coin, Tile::Empty)).into_iter().collect()
            });
        }),
    ]
}

/// Changes cells of each level before a tick of the rules, depending on its player, and restores the drawn cells after
/// it.
pub(super) fn while_played(app: &mut App, cells: impl Fn(&Level, &Body) -> Vec<Cell> + Send + Sync + 'static) {
    app.add_systems(
        FixedUpdate,
        (
            (move |mut arenas: Query<(&Arena, &mut Tiles)>, players: Query<&PlayerBody>| {
                for (arena, mut tiles) in &mut arenas {
                    let Ok(player) = players.get(arena.player) else { continue };
                    for ([x, y], tile) in cells(&arena.level, &player.0) {
                        tiles.bypass_change_detection().0.set(x, y, tile);
                    }
                }
            })
            .before(CoinRunSystems),
            restore.after(CoinRunSystems),
        ),
    );
}

fn restore(mut arenas: Query<(&Arena, &mut Tiles)>) {
    for (arena, mut tiles) in &mut arenas {
        tiles.bypass_change_detection().0 = arena.level.tiles.clone();
    }
}

fn invisible_wall(level: &Level, x: i32, height: i32) -> Vec<Cell> {
    let low = surface(level, x);
    let free = (low..SIZE).filter(|&y| matches!(level.tiles.get(x, y), Tile::Empty | Tile::Barrier));
    free.take(height as usize).map(|y| ([x, y], Tile::Wall)).collect()
}

fn missing_ground(level: &Level, left: i32, width: i32) -> Vec<Cell> {
    // Pits hold no player anyway.
    let is_ground = |x: &i32| surface(level, *x) > 0 && !level.tiles.get(*x, surface(level, *x)).is_lava();
    let columns = (left..level.coin[0]).filter(is_ground).take(width as usize);
    columns.flat_map(|x| (0..surface(level, x)).map(move |y| ([x, y], Tile::Empty))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{Mode, generate};

    #[test]
    fn what_is_changed_lies_between_start_and_coin_and_is_another_tile() {
        for seed in 0..50 {
            let level = generate(Mode::Hard, seed);
            for variant in 0..6 {
                let x = column(&level, variant);
                let wall = invisible_wall(&level, x, pick(&HEIGHTS, variant));
                let holes = missing_ground(&level, x, pick(&HOLES, variant));
                assert!(!wall.is_empty() && !holes.is_empty(), "{seed} {variant}");
                assert!(wall.iter().all(|([x, y], tile)| level.tiles.get(*x, *y) != *tile), "{seed} {variant}");
                assert!(holes.iter().all(|([x, y], _)| level.tiles.get(*x, *y).is_wall()), "{seed} {variant}");
                let columns = wall.iter().chain(&holes).map(|([x, _], _)| *x);
                assert!(columns.min() >= Some(4), "{seed} {variant}");
            }
        }
    }
}

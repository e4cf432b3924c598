//! Levels with an unreachable coin, behind rock or without any, and defects of the player's motion.

use crate::coinrun::{
    components::{Arena, PlayerBody, PlayerMemory, PlaysIn},
    defects::{between, fill, of_levels, summit, surface},
    level::{Level, LevelParts, Spawn},
    rules::{Body, PlayerState},
    tile::{SIZE, Tile},
};
use bevy::prelude::*;
use playbot_harness::{
    defect::{DefectKind, PLACES, pick, place, variants},
    prelude::*,
};
use playbot_learner::rng::{ChaCha8Rng, below};

/// Thickness of the rock around a coin. Upwards a player may slip through a single layer, never through two.
const THICK: i32 = 3;

pub(super) fn defects() -> Vec<DefectKind> {
    vec![
        of_levels("walled-goal", "rock closes the coin off", walled_goal),
        of_levels("sealed-start", "rock closes the start in", sealed_start),
    ]
}

/// Builds a wall over the full height of the level, two columns thick, or rock on all sides of the coin.
fn walled_goal(parts: &mut LevelParts, rng: &mut ChaCha8Rng) -> Option<()> {
    let [x, y] = parts.coin;
    if below(rng, 2) == 0 {
        let at = between(rng, (x * 3 / 5).max(5), x - 4)?;
        wall_off(parts, at);
        return Some(());
    }
    // The start stays free.
    (x - THICK > 4).then_some(())?;
    fill(parts, [x - THICK, y - THICK], [2 * THICK + 1, 2 * THICK + 1], Tile::Wall);
    parts.tiles.set(x, y, Tile::Coin);
    Some(())
}

/// Builds a wall over the full height of the level, right after the start. Left of the start the level ends.
fn sealed_start(parts: &mut LevelParts, rng: &mut ChaCha8Rng) -> Option<()> {
    let at = between(rng, 3, (parts.coin[0] - 4).min(8))?;
    wall_off(parts, at);
    Some(())
}

fn wall_off(parts: &mut LevelParts, x: i32) {
    fill(parts, [x, 0], [2, SIZE], Tile::Wall);
}

// Positions of a rules defect along a level.

/// Shares of the path to the coin from which on a defect acts. They differ, so testers that get further find more.
const FROM: [f32; PLACES as usize] = [0.0, 0.35, 0.7];

/// Shares of the path at which an obstacle stands.
const AT: [f32; PLACES as usize] = [0.25, 0.5, 0.75];

/// Returns the column at which the defect begins to act, in tiles from the left.
pub(super) fn begins(level: &Level, variant: u32) -> f32 {
    FROM[place(variant)] * level.coin[0] as f32
}

/// Returns a column between start and coin for an obstacle.
pub(super) fn column(level: &Level, variant: u32) -> i32 {
    let [coin, _] = level.coin;
    ((AT[place(variant)] * coin as f32) as i32).min(coin - 3).max(4)
}

// Levels with an unreachable coin, without any rock.

/// Rows above the highest ground at which nothing can be touched any more. A jump lifts by less than seven, and the
/// head reaches two higher at the most.
const SKY: i32 = 10;

pub(super) fn unreachable_defects() -> Vec<DefectKind> {
    vec![
        of_levels("goal-in-the-sky", "the coin hangs higher than any jump leads", goal_in_the_sky),
        of_levels("hazard-wall", "saws or lava fill a column from the ground to the sky", hazard_wall),
    ]
}

fn goal_in_the_sky(parts: &mut LevelParts, rng: &mut ChaCha8Rng) -> Option<()> {
    let y = between(rng, summit(parts) + SKY, SIZE - 3)?;
    let x = between(rng, 3, parts.coin[0])?;
    (parts.tiles.get(x, y) == Tile::Empty).then_some(())?;
    parts.tiles.set(parts.coin[0], parts.coin[1], Tile::Empty);
    parts.tiles.set(x, y, Tile::Coin);
    parts.coin = [x, y];
    Some(())
}

/// Puts up a column that kills on touch, at any height. A tick moves a player by half a tile, so no player passes a
/// column without touching it.
fn hazard_wall(parts: &mut LevelParts, rng: &mut ChaCha8Rng) -> Option<()> {
    let x = between(rng, 6, parts.coin[0] - 4)?;
    if below(rng, 2) == 0 {
        fill(parts, [x, 1], [1, SIZE - 2], Tile::Lava);
    } else {
        let low = surface(parts, x);
        fill(parts, [x, low], [1, SIZE - 1 - low], Tile::Empty);
        parts.spawns.extend((low..SIZE - 1).map(|y| Spawn::Saw([x, y])));
    }
    Some(())
}

// Defects of the player's motion.

/// Addition to the vertical speed of a player in the air, in each tick, tiles per tick. It is half of the gravity less,
/// and three quarters more.
const LIFT: [f32; 2] = [0.1, -0.15];

/// Factor on the speed with which a jump begins: too low for the steps of levels, and too high.
const JUMP: [f32; 2] = [0.6, 1.4];

/// Factor on the horizontal speed, in each tick.
const DRAG: [f32; 2] = [0.5, 0.8];

/// Speed of the wind, tiles per tick, against the path and along it.
const WIND: [f32; 2] = [-0.04, 0.04];

/// Vertical speed above which a player has just jumped, tiles per tick.
const RISES: f32 = 1.0;

pub(super) fn motion_defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules(
            "wrong-gravity",
            "gravity is too weak or too strong",
            variants(LIFT.len()),
            |app, variant| {
                let lift = pick(&LIFT, variant);
                after_each_tick(app, variant, move |body, _, _| {
                    // A standing player has no vertical speed at all.
                    if body.vy != 0.0 {
                        body.vy += lift;
                    }
                });
            },
        ),
        DefectKind::rules("wrong-jump", "jumps are too low or too high", variants(JUMP.len()), |app, variant| {
            let factor = pick(&JUMP, variant);
            after_each_tick(app, variant, move |body, memory, _| {
                if memory.supported && body.vy > RISES {
                    body.vy *= factor;
                }
            });
        }),
        DefectKind::rules("slow-player", "players run too slowly", variants(DRAG.len()), |app, variant| {
            let factor = pick(&DRAG, variant);
            after_each_tick(app, variant, move |body, _, _| body.vx *= factor);
        }),
        DefectKind::rules(
            "drift",
            "something pushes players in the air sideways",
            variants(WIND.len()),
            |app, variant| {
                let wind = pick(&WIND, variant);
                after_each_tick(app, variant, move |body, memory, _| {
                    if !memory.supported {
                        body.vx += wind;
                    }
                });
            },
        ),
    ]
}

/// Changes each playing player that is far enough along its level, after each tick.
pub(super) fn after_each_tick(
    app: &mut App,
    variant: u32,
    change: impl Fn(&mut Body, &PlayerState, &Level) + Send + Sync + 'static,
) {
    app.add_systems(
        FixedPostUpdate,
        (move |mut players: Query<(&Control, &Episode, &PlaysIn, &PlayerMemory, &mut PlayerBody)>,
               arenas: Query<&Arena>| {
            for (control, episode, plays_in, memory, mut body) in &mut players {
                let Ok(arena) = arenas.get(plays_in.0) else { continue };
                let plays = control.is_active() && episode.is_running();
                if plays && body.0.x >= begins(&arena.level, variant) {
                    change(&mut body.0, &memory.0, &arena.level);
                }
            }
        })
        .before(PlaybotSystems::Judge),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{Mode, generator::generate};

    #[test]
    fn variants_go_through_the_places() {
        let level = generate(Mode::Hard, 1);
        let coin = level.coin[0];
        assert_eq!(begins(&level, 3), 0.0);
        assert!(begins(&level, 1) < begins(&level, 2) && begins(&level, 5) == begins(&level, 2));
        assert!(column(&level, 0) < column(&level, 1) && column(&level, 2) < coin);
    }
}

//! Levels with an unreachable coin, without any rock.

use playbot_lab::defect::DefectKind;
use playbot_learner::rng::{ChaCha8Rng, below};

use super::edit::{between, fill, of_levels, summit, surface};
use crate::coinrun::{
    level::LevelParts,
    spawn::Spawn,
    tile::{SIZE, Tile},
};

/// Rows above the highest ground at which nothing can be touched any more: a jump lifts by less than seven, and the
/// head reaches two higher at the most.
const SKY: i32 = 10;

pub(super) fn defects() -> Vec<DefectKind> {
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

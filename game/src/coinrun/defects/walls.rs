//! Levels with rock across the path.

use playbot_lab::defect::DefectKind;
use playbot_learner::rng::{ChaCha8Rng, below};

use super::edit::{between, fill, of_levels};
use crate::coinrun::{
    level::LevelParts,
    tile::{SIZE, Tile},
};

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

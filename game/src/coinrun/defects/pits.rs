//! Levels with missing ground.

use playbot_lab::defect::DefectKind;
use playbot_learner::rng::{ChaCha8Rng, below};

use super::edit::{between, dig, of_levels, summit};
use crate::coinrun::{level::LevelParts, tile::Tile};

pub(super) fn defects() -> Vec<DefectKind> {
    vec![
        of_levels("wide-pit", "a pit on the only path is wider than any jump", wide_pit),
        of_levels("missing-floor", "the ground of the start or of the path's end is missing", missing_floor),
    ]
}

/// Returns the width of a pit that no jump crosses. A jump is back at its height after 16 ticks; from there it falls by
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

//! Editing of a level in its text form.

use playbot_lab::defect::DefectKind;
use playbot_learner::rng::{ChaCha8Rng, below};

use crate::coinrun::{
    level::{Level, LevelParts},
    level_text,
    spawn::Spawn,
    tile::{SIZE, Tile},
};

/// Breaks the parts of a level; `None` if it has no suitable position.
pub(super) type Break = fn(&mut LevelParts, &mut ChaCha8Rng) -> Option<()>;

/// Returns a defect of levels.
pub(super) fn of_levels(class: &'static str, about: &'static str, change: Break) -> DefectKind {
    DefectKind::level(class, about, move |text: &str, rng: &mut ChaCha8Rng| changed(text, rng, change))
}

fn changed(text: &str, rng: &mut ChaCha8Rng, change: Break) -> Option<String> {
    let level = level_text::parse(text).ok()?.level::<Level>()?;
    let mut parts = level.parts().clone();
    change(&mut parts, rng)?;
    Some(serde_json::json!(Level::new(parts).to_level_text()).to_string())
}

/// Returns one of these columns, both ends included; `None` if there are none.
pub(super) fn between(rng: &mut ChaCha8Rng, first: i32, last: i32) -> Option<i32> {
    let count = u64::try_from(last - first + 1).ok().filter(|&count| count > 0)?;
    Some(first + below(rng, count) as i32)
}

/// Returns the height of the ground of a column: the row of its lowest tile without ground.
pub(super) fn surface(parts: &LevelParts, x: i32) -> i32 {
    (0..SIZE).find(|&y| !parts.tiles.get(x, y).is_wall()).unwrap_or(SIZE)
}

/// Returns the highest row for standing between the start and the coin, on ground or on crates.
pub(super) fn summit(parts: &LevelParts) -> i32 {
    let is_wall = |x: i32, y: i32| parts.tiles.get(x, y).is_wall();
    let cells = (1..=parts.coin[0]).flat_map(|x| (0..SIZE - 1).map(move |y| (x, y)));
    let ground = cells.filter(|&(x, y)| is_wall(x, y) && !is_wall(x, y + 1)).map(|(_, y)| y + 1);
    let crates = parts.spawns.iter().filter_map(|spawn| match *spawn {
        Spawn::Crate { cell, .. } => Some(cell[1] + 1),
        _ => None,
    });
    ground.chain(crates).max().unwrap_or(1)
}

/// Fills a block of cells, the first of which is the one at the lower left, and removes their inhabitants.
pub(super) fn fill(parts: &mut LevelParts, [left, low]: [i32; 2], [width, height]: [i32; 2], tile: Tile) {
    parts.tiles.fill(left, low, width, height, tile);
    parts.spawns.retain(|spawn| {
        let [x, y] = spawn.cell();
        !((left..left + width).contains(&x) && (low..low + height).contains(&y))
    });
}

/// Removes the ground of these columns. Lava lies at the bottom of the world, so standing there is impossible.
pub(super) fn dig(parts: &mut LevelParts, left: i32, width: i32) {
    fill(parts, [left, 0], [width, SIZE - 1], Tile::Empty);
    fill(parts, [left, 0], [width, 1], Tile::LavaTop);
}

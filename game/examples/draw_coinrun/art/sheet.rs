//! Drawings put together: one sheet of figures, and a strip of tiles for each ground.

use super::{canvas::Canvas, sprite_text::Drawings};

/// Texels of a tile's side.
const SIDE: usize = 16;
/// Cells of the sheet of figures from left to right.
const COLUMNS: usize = 16;

/// The grounds, in the order of the level's draws.
pub const GROUNDS: [&str; 6] = ["dirt", "grass", "planet", "sand", "snow", "stone"];

/// Returns the figures: players in a row of double height, then enemies, crates and saws, then the enemies' second
/// steps.
pub fn figures(drawings: &Drawings) -> Result<Canvas, String> {
    let mut sheet = Canvas::new(COLUMNS * SIDE, 4 * SIDE);
    let poses = ["stand", "walk1", "walk2"];
    let players = (0..5).flat_map(|colour| poses.map(|pose| format!("player_{colour}_{pose}")));
    let still = (0..4).map(|number| format!("crate_{number}")).chain(["saw_1".to_owned(), "saw_2".to_owned()]);
    let enemies = |step: usize| (0..9).map(move |number| format!("enemy_{number}_{step}"));
    let rows: [(usize, usize, Vec<String>); 3] =
        [(0, 2, players.collect()), (2, 1, enemies(1).chain(still).collect()), (3, 1, enemies(2).collect())];
    for (row, height, names) in rows {
        for (column, name) in names.iter().enumerate() {
            let drawing = sized(drawings, name, height * SIDE)?;
            sheet.paste(drawing, column * SIDE, row * SIDE);
        }
    }
    Ok(sheet)
}

/// Returns the tiles of one ground from top to bottom: inner ground, surface, inner lava, surface of lava, coin.
pub fn ground(drawings: &Drawings, name: &str) -> Result<Canvas, String> {
    let names = [name, &format!("{name}_top"), "lava", "lava_top", "coin"];
    let mut strip = Canvas::new(SIDE, names.len() * SIDE);
    for (row, name) in names.into_iter().enumerate() {
        strip.paste(sized(drawings, name, SIDE)?, 0, row * SIDE);
    }
    Ok(strip)
}

fn sized<'a>(drawings: &'a Drawings, name: &str, height: usize) -> Result<&'a Canvas, String> {
    let drawing = drawings.get(name).ok_or(format!("`{name}` is not drawn"))?;
    if (drawing.width, drawing.height) == (SIDE, height) {
        return Ok(drawing);
    }
    Err(format!("`{name}` has {} × {} texels; it must have {SIDE} × {height}", drawing.width, drawing.height))
}

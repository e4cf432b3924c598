//! Every picture of CoinRun.

use playbot_assets::coinrun::SPRITES;

use super::{backdrop, canvas::Canvas, scenes, sheet, sprite_text};

/// Returns every picture with its file name in `assets/coinrun`.
///
/// # Errors
///
/// The drawings cannot be read: the line and what is wrong with it.
pub fn pictures() -> Result<Vec<(String, Canvas)>, String> {
    let drawings = sprite_text::read(SPRITES)?;
    let mut pictures = vec![("figures.png".to_owned(), sheet::figures(&drawings)?)];
    for ground in sheet::GROUNDS {
        pictures.push((format!("ground_{ground}.png"), sheet::ground(&drawings, ground)?));
    }
    for scene in scenes::all() {
        pictures.push((format!("backdrop_{}.png", scene.name), backdrop::paint(&scene)));
    }
    Ok(pictures)
}

//! Draws `assets/coinrun/*.png` anew: tiles and figures from `assets/coinrun/sprites.txt`, backdrops from `scenes.rs`.
//!
//! ```sh
//! cargo run --release --example draw_coinrun
//! ```
#![allow(clippy::print_stdout, reason = "it says what it has drawn")]

mod art;

use std::{error::Error, fs::File, io::BufWriter, path::Path};

use art::canvas::Canvas;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/coinrun");
    for (name, picture) in art::pictures()? {
        write(&folder.join(&name), &picture)?;
        println!("{name}: {} × {}", picture.width, picture.height);
    }
    Ok(())
}

/// Writes a picture with a palette, which keeps it small.
fn write(path: &Path, picture: &Canvas) -> Result<(), Box<dyn Error>> {
    let mut colours = picture.texels.clone();
    colours.sort_unstable();
    colours.dedup();
    if colours.len() > 256 {
        return Err(format!("{} has {} colours; at most 256 fit", path.display(), colours.len()).into());
    }
    let index = |texel| colours.binary_search(texel).expect("made of the same texels") as u8;
    let mut encoder =
        png::Encoder::new(BufWriter::new(File::create(path)?), picture.width as u32, picture.height as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.set_palette(colours.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect::<Vec<_>>());
    encoder.set_trns(colours.iter().map(|[.., alpha]| *alpha).collect::<Vec<_>>());
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&picture.texels.iter().map(index).collect::<Vec<_>>())?;
    Ok(writer.finish()?)
}

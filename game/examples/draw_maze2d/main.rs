//! Draws `assets/maze2d/*.png` anew.
//!
//! ```sh
//! cargo run --release --example draw_maze2d
//! ```
#![allow(clippy::print_stdout, reason = "it says what it has drawn")]

mod art;

use std::{error::Error, fs::File, io::BufWriter, path::Path};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/maze2d");
    for (name, texels) in art::pictures() {
        let height = texels.len() / art::SIDE;
        let file = BufWriter::new(File::create(folder.join(name))?);
        let mut encoder = png::Encoder::new(file, art::SIDE as u32, height as u32);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(texels.as_flattened())?;
        writer.finish()?;
        println!("{name}: {} × {height}", art::SIDE);
    }
    Ok(())
}

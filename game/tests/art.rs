//! Tests that the drawings in `assets` match their sources.

#[path = "../examples/draw_coinrun/art/mod.rs"]
mod art;
#[path = "../examples/draw_maze2d/art.rs"]
mod maze2d_art;

use std::{fs::File, io::BufReader, path::Path};

/// Returns the width, height and RGBA bytes of a PNG.
fn read(path: &Path) -> (usize, usize, Vec<u8>) {
    let file = File::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().expect("a PNG");
    let mut bytes = vec![0; reader.output_buffer_size().expect("small")];
    let info = reader.next_frame(&mut bytes).expect("a PNG");
    assert_eq!(info.color_type, png::ColorType::Rgba, "{}", path.display());
    (info.width as usize, info.height as usize, bytes)
}

fn pngs_in(folder: &Path) -> usize {
    let files = std::fs::read_dir(folder).expect("a folder").filter_map(Result::ok);
    files.filter(|file| file.path().extension().is_some_and(|ending| ending == "png")).count()
}

#[test]
fn every_png_is_as_its_source_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/coinrun");
    let pictures = art::pictures().expect("the drawings can be read");
    for (name, picture) in &pictures {
        let (width, height, bytes) = read(&folder.join(name));
        assert_eq!((width, height), (picture.width, picture.height), "{name}");
        assert!(
            bytes == picture.texels.as_flattened(),
            "{name}: draw it with `cargo run --release --example draw_coinrun`"
        );
    }
    assert_eq!(pngs_in(&folder), pictures.len(), "no PNG without a source");
}

#[test]
fn every_png_of_maze2d_is_as_its_source_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/maze2d");
    let pictures = maze2d_art::pictures();
    for (name, texels) in &pictures {
        let size = (maze2d_art::SIDE, texels.len() / maze2d_art::SIDE);
        let drawn = (size.0, size.1, texels.as_flattened().to_vec());
        assert!(read(&folder.join(name)) == drawn, "{name}: draw it with `cargo run --release --example draw_maze2d`");
    }
    assert_eq!(pngs_in(&folder), pictures.len(), "no PNG without a source");
}

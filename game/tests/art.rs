//! The drawings in `assets` are those of their sources.

#[path = "../examples/draw_coinrun/art/mod.rs"]
mod art;

use std::{fs::File, io::BufReader, path::Path};

#[test]
fn every_png_is_as_its_source_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/coinrun");
    let pictures = art::pictures().expect("the drawings can be read");
    for (name, picture) in &pictures {
        let file = File::open(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        let mut decoder = png::Decoder::new(BufReader::new(file));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().expect("a PNG");
        let mut bytes = vec![0; reader.output_buffer_size().expect("small")];
        let info = reader.next_frame(&mut bytes).expect("a PNG");
        assert_eq!((info.width as usize, info.height as usize), (picture.width, picture.height), "{name}");
        assert_eq!(info.color_type, png::ColorType::Rgba, "{name}");
        assert!(
            bytes == picture.texels.as_flattened(),
            "{name}: draw it with `cargo run --release --example draw_coinrun`"
        );
    }
    let files = std::fs::read_dir(&folder).expect("a folder").filter_map(Result::ok);
    let pngs = files.filter(|file| file.path().extension().is_some_and(|ending| ending == "png")).count();
    assert_eq!(pngs, pictures.len(), "no PNG without a source");
}

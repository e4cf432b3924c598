//! Shared parts of the games' pictures: drawings that come with the program, and positions for the arenas of one World.

use bevy::{
    asset::RenderAssetUsages,
    image::{CompressedImageFormats, ImageSampler, ImageType},
    prelude::*,
};

/// Returns a drawing that comes with the program, from the bytes of its PNG.
pub(crate) fn decode(png: &[u8]) -> Image {
    let kind = ImageType::Extension("png");
    let (formats, usages) = (CompressedImageFormats::NONE, RenderAssetUsages::default());
    Image::from_buffer(png, kind, formats, true, ImageSampler::nearest(), usages)
        .expect("the drawings are part of the program, and a test decodes each")
}

/// Arenas in a row.
const COLUMNS: u32 = 8;

/// Positions for arenas side by side, so that no agent sees the arena of another. The first is at the origin.
#[derive(Resource, Debug, Default, Reflect)]
#[reflect(Resource)]
pub(crate) struct ArenaGrid {
    /// Number of used positions. Not reflected: an arena is the same, however many others there are.
    #[reflect(ignore)]
    taken: u32,
}

impl ArenaGrid {
    /// Returns the next free position, of squares that are `spacing` wide.
    pub(crate) fn next(&mut self, spacing: f32) -> Transform {
        let (column, row) = (self.taken % COLUMNS, self.taken / COLUMNS);
        self.taken += 1;
        Transform::from_xyz(column as f32 * spacing, row as f32 * spacing, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arenas_fill_row_after_row() {
        let mut grid = ArenaGrid::default();
        let places: Vec<Vec3> = (0..10).map(|_| grid.next(96.0).translation).collect();
        assert_eq!(places[0], Vec3::ZERO);
        assert_eq!(places[7], Vec3::new(672.0, 0.0, 0.0));
        assert_eq!(places[8], Vec3::new(0.0, 96.0, 0.0));
        assert_eq!(places[9], Vec3::new(96.0, 96.0, 0.0));
    }
}

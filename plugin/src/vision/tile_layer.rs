//! A grid of tiles that is drawn as one.

use bevy::{asset::AssetId, prelude::*};

/// A grid of square tiles with side 1 in its own coordinates; its `Transform` positions and scales
/// it. Cell (0, 0) has its bottom left corner at the origin.
///
/// The tileset is a vertical strip of square tiles: tile `i` is rows `i * w..(i + 1) * w` of an
/// image of width `w`. A pixel with an alpha of at least 128 is opaque, and others are not drawn.
///
/// A grid without cells is a uniform ground of its `outside` tile. Cameras draw the outside as far
/// as can be seen from the grid (see their `TileBorder`). A game whose agents leave the grid must
/// move the layer along, by whole cells.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(Component)]
#[require(Transform, Visibility)]
pub struct TileLayer {
    /// The strip of tiles.
    pub tileset: Handle<Image>,
    /// Cells from left to right; may be 0.
    pub columns: u32,
    /// Cells from bottom to top; may be 0.
    pub rows: u32,
    /// `rows * columns` tile numbers, bottom row first; [`TileLayer::EMPTY`] is not drawn.
    pub cells: Vec<u16>,
    /// The tile of everything outside the grid; [`TileLayer::EMPTY`] for nothing.
    pub outside: u16,
}

impl TileLayer {
    /// The number that stands for no tile.
    pub const EMPTY: u16 = u16::MAX;

    /// Returns whether there is a tile number for every cell.
    pub(crate) fn is_complete(&self) -> bool {
        self.cells.len() == self.columns as usize * self.rows as usize
    }

    /// Returns the tile at a cell, inside or outside the grid.
    #[inline]
    pub fn tile(&self, column: i32, row: i32) -> u16 {
        let inside = (0..self.columns as i32).contains(&column) && (0..self.rows as i32).contains(&row);
        if inside { self.cells[row as usize * self.columns as usize + column as usize] } else { self.outside }
    }
}

/// Advice for a sprite that [lacks an image](lacks_image).
pub(crate) const NO_IMAGE: &str = "set `Sprite::image`, or `custom_size` for a rectangle of one colour";

/// Returns whether a sprite shows nothing because it has no image. A sprite with a size of its own
/// is a rectangle of one colour, as [`Sprite::from_color`] makes them, and needs no image.
///
/// Bevy keeps a white texel under the handle of no image, and so draws a sprite of neither kind as a white dot.
pub(crate) fn lacks_image(sprite: &Sprite) -> bool {
    sprite.custom_size.is_none() && sprite.image.id() == AssetId::default()
}

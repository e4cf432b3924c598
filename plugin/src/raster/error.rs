//! Errors of drawing.

use bevy::prelude::*;
use thiserror::Error;

use crate::vision::NO_IMAGE;

/// The reason why a picture cannot be drawn. The report names the entity.
#[derive(Clone, Debug, PartialEq, Error)]
pub(super) enum RasterError {
    #[error("the width of what the sensor sees is {0}; it must be a number above 0")]
    Width(f32),
    #[error("the sensor's target {0} is gone or has no Transform; remove the sensor with it, or give it another")]
    NoTarget(Entity),
    #[error("the sensor's target is at {0}; the game must give it a finite position")]
    LostTarget(Vec2),
    #[error("{0}")]
    Options(#[from] crate::vision::VisionError),
    #[error("entity {0}: {1}")]
    Thing(Entity, Undrawable),
}

/// The reason why an entity cannot be drawn.
#[derive(Clone, Debug, PartialEq, Error)]
pub(super) enum Undrawable {
    #[error("the sprite has no image: {NO_IMAGE}")]
    NoImage,
    #[error("the image is not loaded; wait for it before the first episode, or add it to `Assets<Image>`")]
    NotLoaded,
    #[error("the image's pixels were given to the GPU and dropped; load it with `RenderAssetUsages::default()`")]
    NoPixels,
    #[error("the image has no pixels: its size is {width}x{height}; it must have at least one")]
    Empty { width: u32, height: u32 },
    #[error("images of format {0} cannot be drawn; use Rgba8UnormSrgb, Bgra8UnormSrgb or Rgba8Unorm")]
    Format(String),
    #[error(
        "the image has {bytes} bytes, but its size is {width}x{height}; only flat images without mipmaps are drawn"
    )]
    Bytes { bytes: usize, width: u32, height: u32 },
    #[error("the texture atlas has no layout, or no section {0}")]
    Atlas(usize),
    #[error("the image mode {0} cannot be drawn; use `SpriteImageMode::Auto` or `Scale`")]
    Mode(&'static str),
    #[error("the tile layer has {cells} cells for {columns} columns and {rows} rows")]
    Cells { cells: usize, columns: u32, rows: u32 },
    #[error("the tileset is {width}x{height}; it must be a strip of square tiles, one below the other")]
    Strip { width: u32, height: u32 },
    #[error("the tile layer asks for tile {tile}, but its tileset has {tiles}")]
    Tile { tile: u16, tiles: u32 },
}

impl RasterError {
    /// Returns the entity that causes the error.
    pub fn entity(&self) -> Option<Entity> {
        match self {
            Self::Thing(entity, _) => Some(*entity),
            _ => None,
        }
    }
}

//! The drawings: a disc, and a strip of two tiles. They are made in code, texel by texel.

use bevy::{image::ImageSampler, prelude::*};

/// Side of a cell's tile, texels: 16 to the metre.
const TILE: u32 = 64;
/// Side of the square that the disc fills, texels.
const DISC: u32 = 32;

/// Numbers of the tiles on the strip.
pub const FLOOR: u16 = 0;
pub const WALL: u16 = 1;

type Texel = [u8; 4];

/// Handles of all drawings.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(Resource)]
pub struct Art {
    /// A white disc.
    pub disc: Handle<Image>,
    /// Floor and wall, one below the other.
    pub tiles: Handle<Image>,
}

impl Art {
    /// Adds the drawings to an app.
    pub fn add_to(images: &mut Assets<Image>) -> Self {
        let tile = |x, y| if y < TILE { floor(x, y) } else { wall(x, y - TILE) };
        Self { disc: images.add(image(DISC, DISC, disc)), tiles: images.add(image(TILE, 2 * TILE, tile)) }
    }
}

/// Returns the floor of one cell.
#[cfg(feature = "view3d")]
pub fn floor_tile() -> Image {
    image(TILE, TILE, floor)
}

/// Returns an image, texel by texel, top row first.
fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> Texel) -> Image {
    // The type of an image's size has no name in a program without a renderer.
    let mut image = Image::default();
    image.texture_descriptor.size.width = width;
    image.texture_descriptor.size.height = height;
    image.data =
        Some((0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y)).collect());
    image.sampler = ImageSampler::nearest();
    image
}

fn disc(x: u32, y: u32) -> Texel {
    let off = |at: u32| 2 * i64::from(at) + 1 - i64::from(DISC);
    let inside = off(x).pow(2) + off(y).pow(2) <= i64::from(DISC).pow(2);
    if inside { [255; 4] } else { [255, 255, 255, 0] }
}

/// Draws light squares of one metre, which make motion visible.
fn floor(x: u32, y: u32) -> Texel {
    let metre = TILE / 4;
    if (x / metre + y / metre).is_multiple_of(2) { [201, 207, 196, 255] } else { [186, 193, 181, 255] }
}

/// Draws a dark tile, with a rim to the cell.
fn wall(x: u32, y: u32) -> Texel {
    let rim = x.min(y).min(TILE - 1 - x).min(TILE - 1 - y) < 2;
    if rim { [66, 70, 84, 255] } else { [84, 88, 104, 255] }
}

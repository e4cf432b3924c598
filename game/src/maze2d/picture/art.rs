//! The drawings, which come with the program.

use std::sync::LazyLock;

use bevy::{
    asset::RenderAssetUsages,
    image::{CompressedImageFormats, ImageSampler, ImageType},
    prelude::*,
};
use playbot_assets::maze2d;

/// Numbers of the tiles on their strip.
pub(super) const WALL: u16 = 0;
pub(super) const FLOOR: u16 = 1;

/// Decoded once for all Worlds: tiles, ball, goal.
static IMAGES: LazyLock<[Image; 3]> =
    LazyLock::new(|| [decode(maze2d::TILES), decode(maze2d::BALL), decode(maze2d::GOAL)]);

fn decode(png: &[u8]) -> Image {
    let kind = ImageType::Extension("png");
    let (formats, usages) = (CompressedImageFormats::NONE, RenderAssetUsages::default());
    Image::from_buffer(png, kind, formats, true, ImageSampler::nearest(), usages)
        .expect("the drawings are part of the program, and a test decodes each")
}

/// Handles of all drawings.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(Resource)]
pub(super) struct Art {
    pub tiles: Handle<Image>,
    pub ball: Handle<Image>,
    pub goal: Handle<Image>,
}

impl Art {
    /// Adds the drawings to an app.
    pub fn add_to(images: &mut Assets<Image>) -> Self {
        let [tiles, ball, goal] = IMAGES.each_ref().map(|image| images.add(image.clone()));
        Self { tiles, ball, goal }
    }
}

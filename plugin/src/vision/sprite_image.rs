//! Detection of sprites without an image.

use bevy::{asset::AssetId, prelude::*};

/// Advice for a sprite that [lacks an image](lacks_image).
pub(crate) const NO_IMAGE: &str = "set `Sprite::image`, or `custom_size` for a rectangle of one colour";

/// Returns whether a sprite shows nothing because it has no image. A sprite with a size of its own
/// is a rectangle of one colour, as [`Sprite::from_color`] makes them, and needs no image.
///
/// Bevy keeps a white texel under the handle of no image, and so draws a sprite of neither kind as a white dot.
pub(crate) fn lacks_image(sprite: &Sprite) -> bool {
    sprite.custom_size.is_none() && sprite.image.id() == AssetId::default()
}

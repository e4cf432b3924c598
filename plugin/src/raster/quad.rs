//! The position of a sprite and the part of its image that it shows, by the rules of Bevy's sprite
//! renderer.

use bevy::{
    prelude::*,
    sprite::{Anchor, SpriteScalingMode},
};

use super::{error::Undrawable, pose::Pose};

/// A parallelogram: a corner and two sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Quad {
    /// The sprite's bottom left corner.
    pub corner: Vec2,
    /// From the left to the right.
    pub across: Vec2,
    /// From the bottom to the top.
    pub up: Vec2,
}

/// A region of an image, in texels from its top left. The bottom left corner of the sprite shows
/// `start`, and the top right corner shows `start + size`. So y decreases upwards, and a flip
/// negates a size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ImageRegion {
    pub start: Vec2,
    pub size: Vec2,
}

/// Computes the quad and the image region of a sprite.
pub(super) fn lay_out(
    sprite: &Sprite,
    anchor: &Anchor,
    pose: &Pose,
    image_size: Vec2,
    layouts: &Assets<TextureAtlasLayout>,
) -> Result<(Quad, ImageRegion), Undrawable> {
    let rect = shown_rect(sprite, image_size, layouts)?;
    let mut region =
        ImageRegion { start: Vec2::new(rect.min.x, rect.max.y), size: Vec2::new(rect.width(), -rect.height()) };
    for (axis, flipped) in [sprite.flip_x, sprite.flip_y].into_iter().enumerate() {
        if flipped {
            region.start[axis] += region.size[axis];
            region.size[axis] = -region.size[axis];
        }
    }
    let mut size = sprite.custom_size.unwrap_or(rect.size());
    let mut shift = Vec2::ZERO;
    match sprite.image_mode {
        SpriteImageMode::Auto => {}
        SpriteImageMode::Scale(mode) => scale(mode, rect.size(), &mut size, &mut shift, &mut region),
        SpriteImageMode::Sliced(_) => return Err(Undrawable::Mode("Sliced")),
        SpriteImageMode::Tiled { .. } => return Err(Undrawable::Mode("Tiled")),
    }
    let corner = (size + shift) * (-anchor.as_vec() - Vec2::splat(0.5));
    let (x, y) = (pose.x.truncate(), pose.y.truncate());
    let quad = Quad { corner: x * corner.x + y * corner.y + pose.at.truncate(), across: x * size.x, up: y * size.y };
    Ok((quad, region))
}

/// Returns the shown rectangle, which counts from the top left of the atlas's section, if there is
/// one.
fn shown_rect(sprite: &Sprite, image_size: Vec2, layouts: &Assets<TextureAtlasLayout>) -> Result<Rect, Undrawable> {
    let Some(atlas) = &sprite.texture_atlas else {
        return Ok(sprite.rect.unwrap_or(Rect { min: Vec2::ZERO, max: image_size }));
    };
    let section = atlas.texture_rect(layouts).ok_or(Undrawable::Atlas(atlas.index))?.as_rect();
    Ok(sprite.rect.map_or(section, |rect| Rect { min: rect.min + section.min, max: rect.max + section.min }))
}

/// The end of the longer axis that is kept: of the image when it fills, of the space when it fits.
#[derive(Clone, Copy)]
enum Keep {
    Start,
    Centre,
    End,
}

/// Keeps the image's aspect ratio: `Fill` modes cut the image, `Fit` modes shrink the rectangle.
fn scale(mode: SpriteScalingMode, texture: Vec2, size: &mut Vec2, shift: &mut Vec2, region: &mut ImageRegion) {
    let (fills, keep) = match mode {
        SpriteScalingMode::FillStart => (true, Keep::Start),
        SpriteScalingMode::FillCenter => (true, Keep::Centre),
        SpriteScalingMode::FillEnd => (true, Keep::End),
        SpriteScalingMode::FitStart => (false, Keep::Start),
        SpriteScalingMode::FitCenter => (false, Keep::Centre),
        SpriteScalingMode::FitEnd => (false, Keep::End),
    };
    let (wanted, given) = (size.x / size.y, texture.x / texture.y);
    let wider = wanted > given;
    let share = if wider { given / wanted } else { wanted / given };
    if fills {
        let axis = usize::from(wider);
        let spare = region.size[axis] * (1.0 - share);
        // Regions start at the bottom, but vertically the top counts as the start.
        region.start[axis] += match (keep, axis) {
            (Keep::Centre, _) => spare * 0.5,
            (Keep::Start, 1) | (Keep::End, 0) => spare,
            _ => 0.0,
        };
        region.size[axis] *= share;
    } else {
        let axis = usize::from(!wider);
        let spare = size[axis] * (1.0 - share);
        size[axis] *= share;
        shift[axis] = match (keep, axis) {
            (Keep::Centre, _) => 0.0,
            (Keep::Start, 0) | (Keep::End, 1) => spare,
            _ => -spare,
        };
    }
}

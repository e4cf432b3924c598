//! One texture for the pictures of many agents.

use bevy::{
    asset::RenderAssetUsages,
    camera::ImageRenderTarget,
    image::ImageSampler,
    prelude::*,
    render::render_resource::{TextureFormat, TextureUsages},
};

use super::CameraError;

/// A texture's rows come back without padding if their length in bytes is a multiple of 256.
const COLUMNS: u32 = 64;

/// Cells in rows, from the top left.
#[derive(Clone, Debug, Default, PartialEq, Eq, Reflect)]
pub(super) struct Layout {
    pub(super) size: UVec2,
    pub(super) cells: Vec<URect>,
}

impl Layout {
    /// Creates room for pictures of these sizes on a texture of at most `limit` pixels a side, about as high as wide.
    pub(super) fn new(sizes: &[UVec2], limit: u32) -> Result<Self, CameraError> {
        let area: u64 = sizes.iter().map(|size| u64::from(size.x) * u64::from(size.y)).sum();
        let widest = sizes.iter().map(|size| size.x).max().unwrap_or(1);
        let width = (area as f64).sqrt().ceil() as u32;
        let width = width.max(widest).next_multiple_of(COLUMNS).min(limit);
        let mut layout = Self { size: UVec2::new(width, 1), cells: Vec::with_capacity(sizes.len()) };
        let (mut corner, mut row) = (UVec2::ZERO, 0);
        for &size in sizes {
            if corner.x + size.x > width {
                corner = UVec2::new(0, corner.y + row);
                row = 0;
            }
            layout.cells.push(URect { min: corner, max: corner + size });
            corner.x += size.x;
            row = row.max(size.y);
        }
        layout.size.y = (corner.y + row).max(1);
        if layout.size.y > limit { Err(CameraError::TooMany { agents: sizes.len(), limit }) } else { Ok(layout) }
    }
}

/// Returns an image to draw on and to copy from. Its colours are stored as the bytes that image files hold.
pub(super) fn target_image(size: UVec2) -> Image {
    let mut image = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba8UnormSrgb, None);
    image.data = None;
    image.copy_on_resize = false;
    image.sampler = ImageSampler::nearest();
    image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    image.asset_usage = RenderAssetUsages::MAIN_WORLD | RenderAssetUsages::RENDER_WORLD;
    image
}

/// Returns a camera's target.
pub(super) fn render_target(image: Handle<Image>) -> bevy::camera::RenderTarget {
    bevy::camera::RenderTarget::Image(ImageRenderTarget { handle: image, scale_factor: 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_lie_inside_and_apart() {
        let sizes: Vec<UVec2> = (0..70).map(|i| UVec2::new(20 + i % 40, 30 + i % 7)).collect();
        let layout = Layout::new(&sizes, 4096).expect("small");
        assert_eq!(layout.size.x % COLUMNS, 0);
        for (i, cell) in layout.cells.iter().enumerate() {
            assert_eq!(cell.size(), sizes[i]);
            assert!(cell.max.x <= layout.size.x && cell.max.y <= layout.size.y);
            for other in &layout.cells[i + 1..] {
                assert!(cell.intersect(*other).is_empty(), "{cell:?} {other:?}");
            }
        }
    }

    #[test]
    fn too_many_are_refused() {
        let sizes = vec![UVec2::splat(64); 17];
        assert_eq!(Layout::new(&sizes, 256), Err(CameraError::TooMany { agents: 17, limit: 256 }));
        assert_eq!(Layout::new(&sizes[..16], 256).map(|layout| layout.size), Ok(UVec2::splat(256)));
    }
}

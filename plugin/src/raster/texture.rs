//! Images as texels, converted once.

use crate::raster::{
    Undrawable,
    canvas::{Rgba, SRGB},
};
use bevy::{asset::AssetId, platform::collections::HashMap, prelude::*};

/// The transparency of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Transparency {
    /// All texels are opaque.
    Opaque,
    /// Each texel is opaque or absent.
    Cutout,
    /// Some texels are half transparent.
    Blended,
}

/// An image of at least one texel, top row first.
#[derive(Clone, Debug)]
pub(super) struct Texture {
    pub width: u32,
    pub height: u32,
    pub texels: Vec<Rgba>,
    pub transparency: Transparency,
}

impl Texture {
    /// Creates a single white texel: the image of rectangles of one colour.
    fn white() -> Self {
        Self { width: 1, height: 1, texels: vec![[255; 4]], transparency: Transparency::Opaque }
    }

    fn of(image: &Image) -> Result<Self, Undrawable> {
        let (width, height) = (image.width(), image.height());
        if width == 0 || height == 0 {
            return Err(Undrawable::Empty { width, height });
        }
        let bytes = image.data.as_ref().ok_or(Undrawable::NoPixels)?;
        // The type of the format has no name in a program without a renderer.
        let format = format!("{:?}", image.texture_descriptor.format);
        let convert: fn([u8; 4]) -> Rgba = match format.as_str() {
            "Rgba8UnormSrgb" => |texel| texel,
            "Bgra8UnormSrgb" => |[blue, green, red, alpha]| [red, green, blue, alpha],
            "Rgba8Unorm" => |[red, green, blue, alpha]| {
                let [red, green, blue] = [red, green, blue].map(|light| SRGB.encode(f32::from(light) / 255.0));
                [red, green, blue, alpha]
            },
            _ => return Err(Undrawable::Format(format)),
        };
        if bytes.len() != 4 * width as usize * height as usize {
            return Err(Undrawable::Bytes { bytes: bytes.len(), width, height });
        }
        let texels: Vec<Rgba> = bytes.as_chunks().0.iter().map(|texel| convert(*texel)).collect();
        let transparency = transparency(&texels);
        Ok(Self { width, height, texels, transparency })
    }
}

fn transparency(texels: &[Rgba]) -> Transparency {
    if texels.iter().all(|texel| texel[3] == 255) {
        Transparency::Opaque
    } else if texels.iter().all(|texel| matches!(texel[3], 0 | 255)) {
        Transparency::Cutout
    } else {
        Transparency::Blended
    }
}

/// Number of a texture in [`Textures`].
pub(super) type TextureId = usize;

/// Textures of the images that were drawn so far.
#[derive(Debug, Default)]
pub(super) struct Textures {
    known: HashMap<AssetId<Image>, TextureId>,
    all: Vec<Texture>,
    /// The last result, which is often asked for again.
    last: Option<(AssetId<Image>, TextureId)>,
}

impl Textures {
    /// Drops everything if an image has changed, come or gone.
    pub fn refresh(&mut self, images: &Res<Assets<Image>>) {
        if images.is_changed() {
            self.known.clear();
            self.all.clear();
            self.last = None;
        }
    }

    /// Returns the texture of an image.
    pub fn find(&mut self, handle: &Handle<Image>, images: &Assets<Image>) -> Result<TextureId, Undrawable> {
        let asset = handle.id();
        if let Some((last, id)) = self.last
            && last == asset
        {
            return Ok(id);
        }
        let id = match self.known.get(&asset) {
            Some(id) => *id,
            None => self.add(asset, images)?,
        };
        self.last = Some((asset, id));
        Ok(id)
    }

    fn add(&mut self, asset: AssetId<Image>, images: &Assets<Image>) -> Result<TextureId, Undrawable> {
        let texture = match images.get(asset) {
            Some(image) => Texture::of(image)?,
            // Bevy's renderer adds this one.
            None if asset == AssetId::default() => Texture::white(),
            None => return Err(Undrawable::NotLoaded),
        };
        self.all.push(texture);
        self.known.insert(asset, self.all.len() - 1);
        Ok(self.all.len() - 1)
    }

    /// Returns a texture that was found.
    pub fn get(&self, id: TextureId) -> &Texture {
        &self.all[id]
    }
}

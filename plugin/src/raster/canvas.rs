//! The pixels of a picture, and the position of the world's objects on them.

use crate::raster::Undrawable;
use bevy::{
    prelude::*,
    sprite::{Anchor, SpriteScalingMode},
};
use std::{ops::Range, sync::LazyLock};

/// The view of a sensor: the map from coordinates of the world to pixels, with y down and (0, 0)
/// the top left corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    centre: Vec2,
    middle: Vec2,
    pixels_per_unit: f32,
}

impl View {
    /// Creates a view of `width` units of the world around `centre`, on a picture of this size in
    /// pixels.
    pub fn new(centre: Vec2, width: f32, size: UVec2) -> Self {
        Self { centre, middle: size.as_vec2() / 2.0, pixels_per_unit: size.x as f32 / width }
    }

    /// Returns the position of an object on the picture.
    pub fn place(&self, quad: &Quad) -> Quad {
        let along = |way: Vec2| Vec2::new(way.x * self.pixels_per_unit, -way.y * self.pixels_per_unit);
        Quad { corner: along(quad.corner - self.centre) + self.middle, across: along(quad.across), up: along(quad.up) }
    }
}

/// A picture that is being painted.
pub(super) struct Canvas<'a> {
    /// `[height, width]`.
    pub pixels: &'a mut [Rgba],
    pub width: usize,
    pub height: usize,
}

impl Canvas<'_> {
    /// Returns the columns and rows of the pixels that a quad may cover.
    pub fn cut(&self, quad: &Quad) -> (Range<usize>, Range<usize>) {
        let side = |corner: f32, a: f32, b: f32, limit| {
            let (least, most) = (a.min(0.0) + b.min(0.0), a.max(0.0) + b.max(0.0));
            covered(corner + least, corner + most, limit)
        };
        let Quad { corner, across, up } = *quad;
        (side(corner.x, across.x, up.x, self.width), side(corner.y, across.y, up.y, self.height))
    }

    /// Returns a part of a row.
    pub fn row(&mut self, y: usize, columns: &Range<usize>) -> &mut [Rgba] {
        let from = y * self.width;
        &mut self.pixels[from + columns.start..from + columns.end]
    }
}

/// Returns the pixels whose centre lies between two edges, the first edge included.
pub(super) fn covered(from: f32, to: f32, limit: usize) -> Range<usize> {
    // Negative numbers and NaN become 0.
    let edge = |edge: f32| ((edge - 0.5).ceil() as usize).min(limit);
    let (start, end) = (edge(from), edge(to));
    start..end.max(start)
}

/// Returns the centre of a pixel.
#[inline]
pub(super) fn centre(pixel: usize) -> f32 {
    pixel as f32 + 0.5
}

/// The map from a picture to a quad's own coordinates, 0 to 1 along its sides.
#[derive(Clone, Copy)]
pub(super) struct Inverse {
    corner: Vec2,
    across: Vec2,
    up: Vec2,
}

impl Inverse {
    /// Returns the map, or `None` for a quad without area.
    pub fn of(quad: &Quad) -> Option<Self> {
        let Quad { corner, across, up } = *quad;
        let area = across.x * up.y - across.y * up.x;
        let scale = 1.0 / area;
        let sound = area != 0.0 && scale.is_finite();
        sound.then_some(Self {
            corner,
            across: Vec2::new(up.y, -up.x) * scale,
            up: Vec2::new(-across.y, across.x) * scale,
        })
    }

    /// Returns the position of a pixel's centre, across and up.
    pub fn at(&self, x: usize, y: usize) -> Vec2 {
        let way = Vec2::new(centre(x), centre(y)) - self.corner;
        Vec2::new(way.x * self.across.x + way.y * self.across.y, way.x * self.up.x + way.y * self.up.y)
    }
}

/// An affine map: three axes and the position of the origin.
///
/// Only sums and products in a fixed order, so the result is the same on every machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    pub x: Vec3,
    pub y: Vec3,
    pub z: Vec3,
    pub at: Vec3,
}

impl Pose {
    /// Returns the pose of a transform.
    pub fn of(transform: &Transform) -> Self {
        let Transform { translation: at, rotation, scale } = *transform;
        if rotation == Quat::IDENTITY {
            return Self { x: Vec3::X * scale.x, y: Vec3::Y * scale.y, z: Vec3::Z * scale.z, at };
        }
        let [i, j, k, w] = rotation.to_array();
        let double = [i + i, j + j, k + k];
        let squares = [i * double[0], j * double[1], k * double[2]];
        let mixed = [j * double[2], i * double[2], i * double[1]];
        let turned = [w * double[0], w * double[1], w * double[2]];
        Self {
            x: Vec3::new(1.0 - (squares[1] + squares[2]), mixed[2] + turned[2], mixed[1] - turned[1]) * scale.x,
            y: Vec3::new(mixed[2] - turned[2], 1.0 - (squares[0] + squares[2]), mixed[0] + turned[0]) * scale.y,
            z: Vec3::new(mixed[1] + turned[1], mixed[0] - turned[0], 1.0 - (squares[0] + squares[1])) * scale.z,
            at,
        }
    }

    /// Returns the pose of a child, or of an entity whose only parent is the stage.
    pub fn child(parent: Option<&Pose>, transform: &Transform) -> Self {
        let own = Self::of(transform);
        parent.map_or(own, |parent| parent.then(&own))
    }

    /// Returns the pose at `inner` in the coordinates of this pose.
    pub fn then(&self, inner: &Pose) -> Self {
        Self { x: self.turn(inner.x), y: self.turn(inner.y), z: self.turn(inner.z), at: self.turn(inner.at) + self.at }
    }

    fn turn(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

// Colours in linear light.

/// A pixel: red, green, blue, alpha.
pub(super) type Rgba = [u8; 4];

/// Steps of the table from light to bytes.
const BINS: usize = 4096;

/// The sRGB transfer curve, both ways.
///
/// It is made of sums, products and divisions alone, so it is the same on every machine.
pub(super) struct Curve {
    /// The light of each byte, 0 to 1.
    light: [f32; 256],
    /// The least light of the next byte.
    next: [f32; 256],
    /// The byte with which each bin of light begins.
    first: [u8; BINS + 1],
}

/// The one curve.
pub(super) static SRGB: LazyLock<Curve> = LazyLock::new(Curve::new);

/// The effect of a sprite's colour on its texels: factors in linear light, alpha last.
///
/// Tints and half-transparent pixels are mixed in linear light, as in an sRGB render target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tint([f32; 4]);

impl Tint {
    /// Leaves texels as they are.
    pub const NONE: Self = Self([1.0; 4]);

    /// Returns the tint of a sprite's colour. Linear and sRGB colours give the same tint on every
    /// machine.
    pub fn of(colour: Color) -> Self {
        if colour == Color::WHITE {
            return Self::NONE;
        }
        if let Color::LinearRgba(linear) = colour {
            return Self(linear.to_f32_array());
        }
        let Srgba { red, green, blue, alpha } = colour.to_srgba();
        let light = |encoded: f32| decode(f64::from(encoded)) as f32;
        Self([light(red), light(green), light(blue), alpha])
    }
}

impl Curve {
    fn new() -> Self {
        let byte = |byte: f64| decode(byte / 255.0) as f32;
        let next = std::array::from_fn(|i| if i < 255 { byte(i as f64 + 0.5) } else { f32::INFINITY });
        let first = std::array::from_fn(|bin| next.partition_point(|least| *least <= bin as f32 / BINS as f32) as u8);
        Self { light: std::array::from_fn(|i| byte(i as f64)), next, first }
    }

    /// Returns the byte nearest to the light.
    pub fn encode(&self, light: f32) -> u8 {
        let light = light.clamp(0.0, 1.0);
        let mut byte = self.first[(light * BINS as f32) as usize];
        while light >= self.next[usize::from(byte)] {
            byte += 1;
        }
        byte
    }

    /// Returns a colour of linear light as an opaque pixel.
    pub fn opaque(&self, Tint([red, green, blue, _]): Tint) -> Rgba {
        [self.encode(red), self.encode(green), self.encode(blue), 255]
    }

    /// Lays a tinted texel over a pixel.
    pub fn blend(&self, texel: Rgba, Tint(tint): Tint, below: Rgba) -> Rgba {
        let alpha = (f32::from(texel[3]) / 255.0 * tint[3]).clamp(0.0, 1.0);
        if alpha == 0.0 {
            return below;
        }
        let mut mixed = [255; 4];
        for channel in 0..3 {
            let light = (self.light[usize::from(texel[channel])] * tint[channel]).clamp(0.0, 1.0);
            let behind = self.light[usize::from(below[channel])];
            mixed[channel] = self.encode(light * alpha + behind * (1.0 - alpha));
        }
        mixed
    }
}

/// Converts sRGB to linear light: IEC 61966-2-1.
fn decode(encoded: f64) -> f64 {
    if encoded <= 0.04045 {
        return encoded / 12.92;
    }
    let base = (encoded + 0.055) / 1.055;
    // To the power of 2.4.
    base * base * fifth_root(base * base)
}

/// Returns the fifth root by Newton's method, from a start that is not below the root. Each step
/// decreases the value until rounding stops it.
fn fifth_root(x: f64) -> f64 {
    let mut root = x.max(1.0);
    loop {
        let fourth = root * root * root * root;
        let next = (4.0 * root + x / fourth) / 5.0;
        // NaN ends the loop as well.
        if next < root { root = next } else { return root }
    }
}

// Layout of sprites, by the rules of Bevy's sprite renderer.

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_covered_if_its_centre_is() {
        assert_eq!(covered(0.5, 2.5, 9), 0..2, "the first edge counts, the last does not");
        assert_eq!(covered(0.6, 2.6, 9), 1..3);
        assert_eq!(covered(-7.0, 99.0, 9), 0..9);
        for nothing in [covered(3.0, 1.0, 9), covered(20.0, 30.0, 9), covered(-9.0, -3.0, 9), covered(0.7, 1.2, 9)] {
            assert!(nothing.is_empty());
        }
        assert!(covered(f32::NAN, f32::NAN, 9).is_empty());
    }

    #[test]
    fn the_inverse_goes_back() {
        let quad = Quad { corner: Vec2::new(3.0, 9.0), across: Vec2::new(4.0, 1.0), up: Vec2::new(2.0, -6.0) };
        let inverse = Inverse::of(&quad).expect("it has an area");
        for (x, y) in [(0, 0), (3, 8), (7, 5)] {
            let at = inverse.at(x, y);
            let back = quad.corner + quad.across * at.x + quad.up * at.y;
            assert!((back - Vec2::new(x as f32 + 0.5, y as f32 + 0.5)).length() < 1e-5, "{back}");
        }
        assert!(Inverse::of(&Quad { across: quad.up, ..quad }).is_none());
    }

    #[test]
    fn bytes_survive_light() {
        for byte in 0..=255u8 {
            assert_eq!(SRGB.encode(SRGB.light[usize::from(byte)]), byte);
        }
        assert_eq!([SRGB.encode(-1.0), SRGB.encode(2.0), SRGB.encode(f32::NAN)], [0, 255, 0]);
    }

    #[test]
    fn the_curve_is_the_standard_one() {
        for (encoded, light) in [(0.04, 0.003095975), (0.5, 0.21404114), (0.735357, 0.5), (1.0, 1.0)] {
            assert!((decode(encoded) - light).abs() < 1e-6, "{encoded}");
        }
        assert!((decode(2.0) - 4.953_848_8).abs() < 1e-4, "brighter than white");
        // Each light has the nearest byte.
        for step in 0..=10_000 {
            let light = step as f32 / 10_000.0;
            let byte = usize::from(SRGB.encode(light));
            assert!(byte == 255 || light < SRGB.next[byte]);
            assert!(byte == 0 || light >= SRGB.next[byte - 1]);
        }
    }

    #[test]
    fn half_of_white_over_black_is_half_the_light() {
        let half = Tint::of(Color::srgba(1.0, 1.0, 1.0, 0.5));
        assert_eq!(SRGB.blend([255; 4], half, [0, 0, 0, 255]), [188, 188, 188, 255]);
        // An alpha of 128 of 255, red over blue: 0.50196 and 0.49804 of the light.
        assert_eq!(SRGB.blend([255, 0, 0, 128], Tint::NONE, [0, 0, 255, 255]), [188, 0, 187, 255]);
        assert_eq!(SRGB.blend([9, 9, 9, 0], Tint::NONE, [1, 2, 3, 255]), [1, 2, 3, 255]);
        // 0.5 is 0.21404 of the light, 200 is 0.57758: their product, 0.12362, is 99.
        let grey = Tint::of(Color::srgb(0.5, 1.0, 0.0));
        assert_eq!(SRGB.blend([200, 200, 200, 255], grey, [7; 4]), [99, 200, 0, 255]);
    }

    #[test]
    fn linear_colours_are_taken_as_they_are() {
        assert_eq!(Tint::of(Color::linear_rgba(0.25, 0.5, 2.0, 0.75)), Tint([0.25, 0.5, 2.0, 0.75]));
        assert_eq!(SRGB.opaque(Tint([0.5, 0.0, 1.0, 0.3])), [188, 0, 255, 255]);
    }

    #[test]
    fn poses_are_what_bevy_computes() {
        let outer = Transform::from_xyz(1.0, -2.0, 3.0)
            .with_rotation(Quat::from_xyzw(0.1, -0.3, 0.5, 0.7).normalize())
            .with_scale(Vec3::new(2.0, -0.5, 1.5));
        let inner = Transform::from_xyz(0.3, 0.4, -0.5)
            .with_rotation(Quat::from_xyzw(-0.4, 0.2, 0.1, 0.6).normalize())
            .with_scale(Vec3::new(0.7, 3.0, 1.0));
        let pose = Pose::child(Some(&Pose::of(&outer)), &inner);
        let affine = (GlobalTransform::from(outer) * inner).affine();
        let expected = [affine.matrix3.x_axis, affine.matrix3.y_axis, affine.matrix3.z_axis, affine.translation];
        for (got, expected) in [pose.x, pose.y, pose.z, pose.at].into_iter().zip(expected) {
            assert!((got - Vec3::from(expected)).length() < 1e-5, "{got} is not {expected}");
        }
    }
}

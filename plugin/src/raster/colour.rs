//! Colours as light: tints and half-transparent pixels are mixed in linear light, as in an sRGB
//! render target.
//!
//! The curves are made of sums, products and divisions alone, so that they are the same on every machine.

use std::sync::LazyLock;

use bevy::prelude::*;

/// A pixel: red, green, blue, alpha.
pub(super) type Rgba = [u8; 4];

/// Steps of the table from light to bytes.
const BINS: usize = 4096;

/// The sRGB transfer curve, both ways.
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

#[cfg(test)]
mod tests {
    use super::*;

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
}

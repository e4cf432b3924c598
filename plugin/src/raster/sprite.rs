//! Painting sprites.

use std::ops::Range;

use super::{
    canvas::{Canvas, Inverse, centre},
    colour::{Curve, Rgba, SRGB, Tint},
    quad::{ImageRegion, Quad},
    texture::{Texture, Transparency},
};

/// A sprite positioned on a picture.
pub(super) struct SpriteOn<'a> {
    /// In pixels.
    pub quad: Quad,
    pub region: ImageRegion,
    pub texture: &'a Texture,
    pub tint: Tint,
}

impl SpriteOn<'_> {
    /// Paints the sprite over the pixels that [`Canvas::cut`] returned. `columns` is working
    /// memory.
    pub fn paint(&self, canvas: &mut Canvas, area: (Range<usize>, Range<usize>), columns: &mut Vec<u32>) {
        let painter = Painter::new(self.texture.transparency, self.tint);
        if self.quad.across.y == 0.0 && self.quad.up.x == 0.0 {
            self.paint_upright(canvas, area, columns, painter);
        } else {
            self.paint_turned(canvas, area, painter);
        }
    }

    /// Paints an upright sprite: all pixels of a column show one column of texels, and all of a row
    /// one row.
    fn paint_upright(
        &self,
        canvas: &mut Canvas,
        (xs, ys): (Range<usize>, Range<usize>),
        columns: &mut Vec<u32>,
        mut painter: Painter,
    ) {
        let Texture { width, height, ref texels, .. } = *self.texture;
        let (quad, region) = (&self.quad, &self.region);
        let across = Axis::new(quad.corner.x, quad.across.x, region.start.x, region.size.x, width);
        let down = Axis::new(quad.corner.y, quad.up.y, region.start.y, region.size.y, height);
        columns.clear();
        columns.extend(xs.clone().map(|x| across.texel_under(x)));
        for y in ys {
            let from = down.texel_under(y) as usize * width as usize;
            painter.paint_row(canvas.row(y, &xs), &texels[from..from + width as usize], columns);
        }
    }

    fn paint_turned(&self, canvas: &mut Canvas, (xs, ys): (Range<usize>, Range<usize>), mut painter: Painter) {
        let Some(inverse) = Inverse::of(&self.quad) else { return };
        let Texture { width, height, ref texels, .. } = *self.texture;
        let region = &self.region;
        let across = Axis::new(0.0, 1.0, region.start.x, region.size.x, width);
        let up = Axis::new(0.0, 1.0, region.start.y, region.size.y, height);
        let inside = 0.0..1.0;
        for y in ys {
            for (x, pixel) in xs.clone().zip(canvas.row(y, &xs)) {
                let at = inverse.at(x, y);
                if inside.contains(&at.x) && inside.contains(&at.y) {
                    let texel = up.texel_at(at.y) as usize * width as usize + across.texel_at(at.x) as usize;
                    *pixel = painter.over(texels[texel], *pixel);
                }
            }
        }
    }
}

/// A map from a coordinate of the picture to that of a texel, along one axis.
struct Axis {
    from: f32,
    start: f32,
    texels_per_pixel: f32,
    first: i32,
    last: i32,
}

impl Axis {
    /// Creates an axis: a side of length `length`, which may be negative, starts at `corner` and
    /// shows `size` texels from `start` on.
    fn new(corner: f32, length: f32, start: f32, size: f32, texels: u32) -> Self {
        let (least, most) = (start.min(start + size), start.max(start + size));
        // Rounding must not select a neighbour on the sheet.
        let last = (most.ceil() as i32 - 1).clamp(0, texels as i32 - 1);
        Self { from: corner, start, texels_per_pixel: size / length, first: (least as i32).clamp(0, last), last }
    }

    #[inline]
    fn texel_under(&self, pixel: usize) -> u32 {
        self.texel_at(centre(pixel))
    }

    #[inline]
    fn texel_at(&self, at: f32) -> u32 {
        // A negative position is before the first texel, however it is rounded.
        let texel = self.start + (at - self.from) * self.texels_per_pixel;
        (texel as i32).clamp(self.first, self.last) as u32
    }
}

/// The blending of texels over pixels.
struct Painter {
    way: Way,
    tint: Tint,
    curve: &'static Curve,
    /// The last blend: texel, pixel before, pixel after. Neighbours are often alike.
    last: [Rgba; 3],
}

#[derive(Clone, Copy)]
enum Way {
    Copy,
    Cut,
    Mix,
}

impl Painter {
    fn new(transparency: Transparency, tint: Tint) -> Self {
        let way = match transparency {
            Transparency::Opaque if tint == Tint::NONE => Way::Copy,
            Transparency::Cutout if tint == Tint::NONE => Way::Cut,
            _ => Way::Mix,
        };
        // A transparent texel leaves a pixel as it is.
        Self { way, tint, curve: &SRGB, last: [[0; 4]; 3] }
    }

    fn paint_row(&mut self, pixels: &mut [Rgba], texels: &[Rgba], columns: &[u32]) {
        let row = pixels.iter_mut().zip(columns.iter().map(|column| texels[*column as usize]));
        match self.way {
            Way::Copy => row.for_each(|(pixel, texel)| *pixel = texel),
            Way::Cut => row.for_each(|(pixel, texel)| *pixel = if texel[3] == 0 { *pixel } else { texel }),
            Way::Mix => row.for_each(|(pixel, texel)| *pixel = self.mix(texel, *pixel)),
        }
    }

    fn over(&mut self, texel: Rgba, below: Rgba) -> Rgba {
        match self.way {
            Way::Copy => texel,
            Way::Cut if texel[3] == 0 => below,
            Way::Cut => texel,
            Way::Mix => self.mix(texel, below),
        }
    }

    fn mix(&mut self, texel: Rgba, below: Rgba) -> Rgba {
        if self.last[..2] != [texel, below] {
            self.last = [texel, below, self.curve.blend(texel, self.tint, below)];
        }
        self.last[2]
    }
}

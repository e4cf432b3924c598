//! Painter of backdrops: a sky and scenery in front of it, layer by layer.
//!
//! Whole numbers only, so every machine paints the same.

use super::canvas::{Canvas, Texel, rgb};

/// Width of a backdrop, texels: four to the tile, half as much again as a level is wide.
pub const WIDTH: i32 = 384;
/// Height of a backdrop, texels: four to the tile.
pub const HEIGHT: i32 = 256;
/// Rows of one shade of the sky.
const BAND: i32 = 16;

/// A backdrop: its name, the colours of its sky from top to bottom, and its layers, the farthest first.
pub struct Scene {
    /// Name, which is part of the file's.
    pub name: &'static str,
    /// Colours of the sky at the top and at the bottom.
    pub sky: [u32; 2],
    /// Scenery in front of it.
    pub layers: Vec<Layer>,
}

/// One kind of scenery, repeated. Heights are texels above the bottom, sizes are texels, colours `0xRRGGBB`.
pub enum Layer {
    /// Round hills up to `height`, `swing` high and about `length` long.
    Hills { height: i32, swing: i32, length: i32, colour: u32 },
    /// The same with pointed tops; `cap` is the colour of their highest part.
    Peaks { height: i32, swing: i32, length: i32, colour: u32, cap: u32 },
    /// Flat-bottomed clouds, scattered between two heights.
    Clouds { low: i32, high: i32, number: i32, size: i32, colour: u32 },
    /// Single bright texels everywhere.
    Stars { number: i32, colour: u32 },
    /// A disc with a darker lower right side: sun, moon, planet.
    Disc { x: i32, height: i32, radius: i32, colour: u32, shade: u32 },
    /// A flat ring around the same place.
    Ring { x: i32, height: i32, radius: i32, colour: u32 },
    /// Trees with round crowns on stems that stand at `height`.
    Trees { height: i32, size: i32, gap: i32, stem: u32, crown: u32 },
    /// Trees with pointed crowns.
    Firs { height: i32, size: i32, gap: i32, stem: u32, crown: u32 },
    /// Houses with lit windows up to about `height`.
    Towers { height: i32, swing: i32, width: i32, colour: u32, window: u32 },
    /// Pillars from the bottom to the top.
    Pillars { width: i32, gap: i32, colour: u32, light: u32 },
    /// Rows of bricks, `width` by `height`, with joints.
    Bricks { width: i32, height: i32, joint: u32 },
    /// Points that hang from above and stand below, as in a cave.
    Stalactites { length: i32, width: i32, colour: u32 },
    /// Level lines of waves, one every `gap`, up to `height`.
    Waves { height: i32, gap: i32, colour: u32 },
    /// Round blots everywhere: bushes, rocks, mist.
    Blots { low: i32, high: i32, number: i32, size: i32, colour: u32 },
}

/// Paints a scene.
pub fn paint(scene: &Scene) -> Canvas {
    let mut canvas = Canvas::new(WIDTH as usize, HEIGHT as usize);
    let seed = scene.name.bytes().fold(7, |seed, byte| noise(seed, i32::from(byte)));
    for y in 0..HEIGHT {
        let colour = mix(scene.sky, y / BAND, HEIGHT / BAND - 1);
        (0..WIDTH).for_each(|x| canvas.set(x, y, colour));
    }
    for (number, layer) in scene.layers.iter().enumerate() {
        Brush { canvas: &mut canvas, seed: noise(seed, number as i32) }.layer(layer);
    }
    canvas
}

/// Returns the colour `step` of `steps` between two.
fn mix(colours: [u32; 2], step: i32, steps: i32) -> Texel {
    let [from, to] = colours.map(rgb);
    let mut mixed = from;
    for (channel, goal) in mixed.iter_mut().zip(to) {
        let (a, b) = (i32::from(*channel), i32::from(goal));
        *channel = (a + (b - a) * step / steps) as u8;
    }
    mixed
}

/// Returns a number that looks random and depends on two others. Not negative.
fn noise(seed: i32, value: i32) -> i32 {
    let mut mixed = (seed as u32).wrapping_mul(0x9e37_79b9) ^ (value as u32).wrapping_mul(0x85eb_ca6b);
    mixed ^= mixed >> 15;
    mixed = mixed.wrapping_mul(0x2c1b_3c6d);
    mixed ^= mixed >> 12;
    mixed = mixed.wrapping_mul(0x297a_2d39);
    ((mixed ^ (mixed >> 15)) >> 1) as i32
}

struct Brush<'a> {
    canvas: &'a mut Canvas,
    seed: i32,
}

impl Brush<'_> {
    /// Returns a random number from `low` to `high`.
    fn random(&self, number: i32, low: i32, high: i32) -> i32 {
        low + noise(self.seed, number) % (high - low + 1)
    }

    fn layer(&mut self, layer: &Layer) {
        match *layer {
            Layer::Hills { height, swing, length, colour } => {
                for x in 0..WIDTH {
                    let top = height + self.wave(x, length, swing, true);
                    self.column(x, 0, top, rgb(colour));
                }
            }
            Layer::Peaks { height, swing, length, colour, cap } => {
                for x in 0..WIDTH {
                    let rise = self.wave(x, length, swing, false);
                    self.column(x, 0, height + rise, rgb(colour));
                    let snow = (height + rise - swing / 4).max(height + swing / 3 + noise(self.seed, x / 3) % 4);
                    self.column(x, snow, height + rise, rgb(cap));
                }
            }
            Layer::Clouds { low, high, number, size, colour } => {
                for cloud in 0..number {
                    let (x, y) = (self.random(3 * cloud, 0, WIDTH), self.random(3 * cloud + 1, low, high));
                    let size = size + self.random(3 * cloud + 2, 0, size / 2);
                    for (dx, radius) in [(-size, size / 2), (0, size), (size, size * 2 / 3)] {
                        self.disc(x + dx, y, radius, rgb(colour), true);
                    }
                }
            }
            Layer::Stars { number, colour } => {
                for star in 0..number {
                    let (x, y) = (self.random(2 * star, 0, WIDTH), self.random(2 * star + 1, 0, HEIGHT));
                    let side = 1 + i32::from(star % 3 == 0);
                    self.block(x, y, side, side, rgb(colour));
                }
            }
            Layer::Disc { x, height, radius, colour, shade } => {
                self.disc(x, height, radius, rgb(shade), false);
                let (lit, shift) = (radius * 7 / 8, radius / 10);
                self.disc(x - shift, height + shift, lit, rgb(colour), false);
            }
            Layer::Ring { x, height, radius, colour } => {
                for dx in -radius..=radius {
                    let dy = dx / 3;
                    self.block(x + dx, height + dy, 1, 3, rgb(colour));
                }
            }
            Layer::Trees { height, size, gap, stem, crown } => {
                for (x, size) in self.row(size, gap) {
                    self.block(x - size / 8, height, size / 4, size, rgb(stem));
                    self.disc(x, height + size, size / 2, rgb(crown), false);
                    self.disc(x - size / 3, height + size * 3 / 4, size / 3, rgb(crown), false);
                    self.disc(x + size / 3, height + size * 3 / 4, size / 3, rgb(crown), false);
                }
            }
            Layer::Firs { height, size, gap, stem, crown } => {
                for (x, size) in self.row(size, gap) {
                    self.block(x - size / 10, height, size / 5, size / 3, rgb(stem));
                    for (part, wide) in [(0, size / 2), (1, size * 2 / 5), (2, size / 4)] {
                        let foot = height + size / 4 + part * size / 4;
                        for row in 0..size * 2 / 5 {
                            let half = wide * (size * 2 / 5 - row) / (size * 2 / 5);
                            self.block(x - half, foot + row, 2 * half + 1, 1, rgb(crown));
                        }
                    }
                }
            }
            Layer::Towers { height, swing, width, colour, window } => {
                for (x, size) in self.row(width, width + width / 4) {
                    let top = height + self.random(x, 0, swing);
                    self.block(x, 0, size, top, rgb(colour));
                    for (column, row) in grid(x + 3, size - 5, 4, top - 6, 7) {
                        if noise(self.seed, column * 64 + row) % 3 > 0 {
                            self.block(column, row, 3, 3, rgb(window));
                        }
                    }
                }
            }
            Layer::Pillars { width, gap, colour, light } => {
                for (x, size) in self.row(width, gap) {
                    self.block(x, 0, size, HEIGHT, rgb(colour));
                    self.block(x + 1, 0, size / 5 + 1, HEIGHT, rgb(light));
                }
            }
            Layer::Bricks { width, height, joint } => {
                for y in (0..HEIGHT).step_by(height as usize) {
                    self.block(0, y, WIDTH, 1, rgb(joint));
                    let shift = (y / height % 2) * width / 2;
                    for x in (-shift..WIDTH).step_by(width as usize) {
                        self.block(x, y, 1, height, rgb(joint));
                    }
                }
            }
            Layer::Stalactites { length, width, colour } => {
                for (x, size) in self.row(width, width * 2 / 3) {
                    let (down, up) =
                        (self.random(x, length / 3, length), self.random(x + 1, length / 4, length * 2 / 3));
                    for dx in 0..size {
                        let part = (2 * dx.min(size - 1 - dx) + 1).min(size);
                        self.column(x + dx, HEIGHT - down * part / size, HEIGHT, rgb(colour));
                        self.column(x + dx, 0, up * part / size, rgb(colour));
                    }
                }
            }
            Layer::Waves { height, gap, colour } => {
                for y in (0..height).step_by(gap as usize) {
                    for x in 0..WIDTH {
                        let phase = (x + noise(self.seed, y) % 16) % 16;
                        self.block(x, y + (phase - 8).abs() / 3, 1, 2, rgb(colour));
                    }
                }
            }
            Layer::Blots { low, high, number, size, colour } => {
                for blot in 0..number {
                    let (x, y) = (self.random(3 * blot, 0, WIDTH), self.random(3 * blot + 1, low, high));
                    let radius = size / 2 + self.random(3 * blot + 2, 0, size / 2);
                    self.disc(x, y, radius, rgb(colour), false);
                }
            }
        }
    }

    /// Returns positions along the bottom with a size of each, about `gap` apart.
    fn row(&self, size: i32, gap: i32) -> Vec<(i32, i32)> {
        let places = (0..WIDTH / gap + 2).map(|number| number * gap - gap / 2);
        places.map(|x| (x + self.random(2 * x, 0, gap / 3), size * self.random(2 * x + 1, 75, 120) / 100)).collect()
    }

    /// Returns a smooth or pointed random curve through a random height, 0 to `swing`, at every half `length`.
    fn wave(&self, x: i32, length: i32, swing: i32, smooth: bool) -> i32 {
        let half = length / 2;
        let (index, part) = (x / half, x % half);
        let knot = |index: i32| {
            let random = noise(self.seed, index) % (swing / 2 + 1);
            if index % 2 == 0 { swing - random } else { random }
        };
        let way = if smooth {
            // 3t² - 2t³ in steps of 1/1024.
            let t = part * 1024 / half;
            (t * t / 1024) * (3 * 1024 - 2 * t) / 1024
        } else {
            part * 1024 / half
        };
        knot(index) + (knot(index + 1) - knot(index)) * way / 1024
    }

    /// Texels from height `low` up to below `high`.
    fn column(&mut self, x: i32, low: i32, high: i32, colour: Texel) {
        self.block(x, low, 1, high - low, colour);
    }

    /// Draws a rectangle by its lower left corner.
    fn block(&mut self, x: i32, low: i32, width: i32, height: i32, colour: Texel) {
        for up in low..low + height {
            (x..x + width).for_each(|x| self.canvas.set(x, HEIGHT - 1 - up, colour));
        }
    }

    /// Draws a disc, or its upper half.
    fn disc(&mut self, x: i32, y: i32, radius: i32, colour: Texel, half: bool) {
        let lowest = if half { 0 } else { -radius };
        for dy in lowest..=radius {
            for dx in -radius..=radius {
                if dx * dx + dy * dy <= radius * radius {
                    self.block(x + dx, y + dy, 1, 1, colour);
                }
            }
        }
    }
}

/// Returns the lower left corners of windows in a wall.
fn grid(x: i32, width: i32, low: i32, high: i32, step: usize) -> impl Iterator<Item = (i32, i32)> {
    let rows = move || (low..high).step_by(step);
    (x..x + width).step_by(step).flat_map(move |column| rows().map(move |row| (column, row)))
}

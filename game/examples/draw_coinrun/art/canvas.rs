//! A picture to draw on.

/// Red, green, blue, alpha.
pub type Texel = [u8; 4];

/// A picture, top row first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Canvas {
    /// Texels from left to right.
    pub width: usize,
    /// Texels from top to bottom.
    pub height: usize,
    /// `width * height` texels.
    pub texels: Vec<Texel>,
}

impl Canvas {
    /// Returns a transparent picture.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, texels: vec![[0; 4]; width * height] }
    }

    /// Sets a texel; outside nothing happens.
    pub fn set(&mut self, x: i32, y: i32, texel: Texel) {
        if (0..self.width as i32).contains(&x) && (0..self.height as i32).contains(&y) {
            self.texels[y as usize * self.width + x as usize] = texel;
        }
    }

    /// Copies a whole picture to a position.
    pub fn paste(&mut self, picture: &Canvas, x: usize, y: usize) {
        for (row, texels) in picture.texels.chunks_exact(picture.width).enumerate() {
            for (column, texel) in texels.iter().enumerate() {
                self.set((x + column) as i32, (y + row) as i32, *texel);
            }
        }
    }
}

/// Returns an opaque colour from `0xRRGGBB`.
pub fn rgb(colour: u32) -> Texel {
    let [_, r, g, b] = colour.to_be_bytes();
    [r, g, b, 255]
}

//! A picture for people, with drawing operations.

use crate::error::CliError;

/// Most pixels of a picture, which take 384 MiB. The longest stack of the default 64 x 64 fits at the largest scale.
const MOST_PIXELS: usize = 1 << 27;

/// Red, green, blue.
pub type Colour = [u8; 3];

/// Pixels, top row first.
pub struct Screen {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    pixels: Vec<Colour>,
}

impl Screen {
    /// Returns an empty screen.
    ///
    /// # Errors
    ///
    /// It is too large: see [`check_size`](Self::check_size).
    pub fn new(width: usize, height: usize, colour: Colour) -> Result<Self, CliError> {
        Self::check_size(width, height)?;
        Ok(Self { width, height, pixels: vec![colour; width * height] })
    }

    /// Checks that a screen of this size is not too large.
    ///
    /// # Errors
    ///
    /// It has more than 2^27 pixels.
    pub fn check_size(width: usize, height: usize) -> Result<(), CliError> {
        if width.checked_mul(height).is_some_and(|pixels| pixels <= MOST_PIXELS) {
            return Ok(());
        }
        Err(CliError::Usage(format!(
            "the picture cannot be made: it would have {width} x {height} pixels, of which {MOST_PIXELS} are possible; \
             try a smaller --scale, or smaller pictures"
        )))
    }

    /// Returns the pixels as bytes, row by row.
    pub fn bytes(&self) -> &[u8] {
        self.pixels.as_flattened()
    }

    /// Fills a rectangle, as far as it is on the screen.
    pub fn block(&mut self, x: usize, y: usize, width: usize, height: usize, colour: Colour) {
        let (left, right) = (x.min(self.width), (x + width).min(self.width));
        for row in y.min(self.height)..(y + height).min(self.height) {
            self.pixels[row * self.width + left..row * self.width + right].fill(colour);
        }
    }

    /// Mixes a colour into a pixel on the screen: with 0 it stays as it is, with 1 the colour replaces it.
    pub fn blend(&mut self, x: usize, y: usize, colour: Colour, share: f32) {
        let pixel = &mut self.pixels[y * self.width + x];
        for (old, new) in pixel.iter_mut().zip(colour) {
            let (from, to) = (f32::from(*old), f32::from(new));
            *old = (from + share * (to - from)).round() as u8;
        }
    }

    /// Draws planes of pixels `[1 or 3, height, width]`, enlarged, with the upper left corner at (x, y).
    pub fn planes(&mut self, planes: &[u8], width: usize, height: usize, scale: usize, (x, y): (usize, usize)) {
        let plane = width * height;
        for row in 0..height {
            for column in 0..width {
                let at = row * width + column;
                let grey = planes[at];
                let colour =
                    if planes.len() == plane { [grey; 3] } else { [grey, planes[plane + at], planes[2 * plane + at]] };
                self.block(x + column * scale, y + row * scale, scale, scale, colour);
            }
        }
    }

    /// Draws a frame of a sensor, enlarged, with the upper left corner at (x, y).
    pub fn frame(&mut self, pixels: &[[u8; 4]], width: usize, scale: usize, (x, y): (usize, usize)) {
        for (at, &[red, green, blue, _]) in pixels.iter().enumerate() {
            self.block(x + at % width * scale, y + at / width * scale, scale, scale, [red, green, blue]);
        }
    }
}

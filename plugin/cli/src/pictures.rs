//! Pictures: steps of an episode, still or animated, and drawings.
//!
//! The folder, in reading order:
//!
//! - `episode_world`: the World of the shown episode.
//! - `caption`: caption of a picture: tick, action, value, and the skill as bars.
//! - `plot`: drawings (charts, maps of levels) as PNGs or SVGs.

pub mod caption;
pub mod episode_world;
pub(crate) mod plot;

use crate::{
    error::CliError,
    pictures::{
        caption::{BACKGROUND, Caption, NARROWEST, NumberBars},
        episode_world::EpisodeStep,
    },
};
use bevy_playbot::vision::ImageOptions;
use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, Filter};

/// The drawing of the steps of an episode.
pub struct Film {
    content: FilmContent,
    tick_hz: f64,
}

impl Film {
    /// Pictures of this form, each pixel enlarged to a square of `scale` pixels, `tick_hz` of them in a second.
    ///
    /// # Errors
    ///
    /// Such a picture is too large.
    pub fn new(options: ImageOptions, scale: u32, tick_hz: f64) -> Result<Self, CliError> {
        let film = Self { content: FilmContent::Pictures(options, scale as usize), tick_hz };
        let [width, height] = film.size();
        Screen::check_size(width, height)?;
        Ok(film)
    }

    /// Numbers instead of pictures.
    pub fn of_numbers(numbers: NumberBars, tick_hz: f64) -> Self {
        Self { content: FilmContent::Numbers(numbers), tick_hz }
    }

    /// Draws one observation ([`Observation::image`](bevy_playbot::observation::Observation::image)) and nothing else;
    /// stacked pictures side by side, the oldest on the left.
    ///
    /// # Errors
    ///
    /// The picture is too large for a PNG.
    pub fn still(&self, image: &[u8]) -> Result<Png, CliError> {
        let [width, height] = self.size();
        let mut screen = Screen::new(width, height, BACKGROUND)?;
        self.draw(&mut screen, image, &[]);
        Ok((to_png(&screen)?, [width, height]))
    }

    /// Draws one step with its caption.
    ///
    /// # Errors
    ///
    /// The picture is too large for a PNG.
    pub fn captioned(&self, step: &EpisodeStep) -> Result<Png, CliError> {
        let (mut screen, caption) = self.screen(std::slice::from_ref(step))?;
        self.draw_step(&mut screen, &caption, step);
        Ok((to_png(&screen)?, [screen.width, screen.height]))
    }

    /// Returns a screen with room for any of the steps, and for the caption below it.
    fn screen(&self, steps: &[EpisodeStep]) -> Result<(Screen, Caption), CliError> {
        let [width, height] = self.size();
        let width = width.max(NARROWEST);
        let skills = steps.iter().map(|step| step.skill.len()).max().unwrap_or(0);
        let caption = Caption::new(width, skills);
        Ok((Screen::new(width, height + caption.height(), BACKGROUND)?, caption))
    }

    fn draw_step(&self, screen: &mut Screen, caption: &Caption, step: &EpisodeStep) {
        screen.block(0, 0, screen.width, screen.height, BACKGROUND);
        self.draw(screen, &step.image, &step.vector);
        caption.draw(screen, self.size()[1], step);
    }

    /// Draws all steps as an endless animation, each with its caption. `drawn` is called for each.
    ///
    /// # Errors
    ///
    /// The pictures are too large for a PNG.
    pub fn animated(&self, steps: &[EpisodeStep], drawn: impl FnMut()) -> Result<Png, CliError> {
        let (mut screen, caption) = self.screen(steps)?;
        let mut bytes = Vec::new();
        self.encode(&mut bytes, &mut screen, steps, &caption, drawn).map_err(too_large)?;
        Ok((bytes, [screen.width, screen.height]))
    }

    fn encode(
        &self,
        bytes: &mut Vec<u8>,
        screen: &mut Screen,
        steps: &[EpisodeStep],
        caption: &Caption,
        mut drawn: impl FnMut(),
    ) -> Result<(), EncodingError> {
        let mut encoder = encoder(bytes, screen);
        encoder.set_animated(steps.len() as u32, 0)?;
        let (numerator, denominator) = self.delay();
        encoder.set_frame_delay(numerator, denominator)?;
        let mut writer = encoder.write_header()?;
        for step in steps {
            self.draw_step(screen, caption, step);
            writer.write_image_data(screen.bytes())?;
            drawn();
        }
        writer.finish()
    }

    /// Returns the seconds of a tick, as a fraction.
    fn delay(&self) -> (u16, u16) {
        if self.tick_hz.fract() == 0.0 && self.tick_hz <= f64::from(u16::MAX) {
            (1, self.tick_hz as u16)
        } else {
            ((1000.0 / self.tick_hz).round().clamp(1.0, f64::from(u16::MAX)) as u16, 1000)
        }
    }

    /// Returns the width and height of the enlarged pictures, side by side, or of the numbers.
    fn size(&self) -> [usize; 2] {
        match &self.content {
            FilmContent::Pictures(ImageOptions { width, height, stack, .. }, scale) => {
                let gaps = (*stack as usize - 1) * scale;
                [*stack as usize * *width as usize * scale + gaps, *height as usize * scale]
            }
            FilmContent::Numbers(numbers) => numbers.size(),
        }
    }

    fn draw(&self, screen: &mut Screen, image: &[u8], vector: &[f32]) {
        match &self.content {
            FilmContent::Pictures(options, scale) => {
                let (width, height) = (options.width as usize, options.height as usize);
                let picture = width * height * options.colours() as usize;
                for (number, planes) in image.chunks_exact(picture).enumerate() {
                    screen.planes(planes, width, height, *scale, (number * (width + 1) * scale, 0));
                }
            }
            FilmContent::Numbers(numbers) => numbers.draw(screen, vector),
        }
    }
}

/// The bytes of a file, and its width and height in pixels.
pub type Png = (Vec<u8>, [usize; 2]);

/// The part above the captions.
enum FilmContent {
    /// Pictures of a form, and their enlargement.
    Pictures(ImageOptions, usize),
    Numbers(NumberBars),
}

/// Encodes a PNG file.
///
/// # Errors
///
/// The picture is too large for a PNG.
pub(crate) fn to_png(screen: &Screen) -> Result<Vec<u8>, CliError> {
    let mut bytes = Vec::new();
    let written = encoder(&mut bytes, screen).write_header().and_then(|mut writer| {
        writer.write_image_data(screen.bytes())?;
        writer.finish()
    });
    written.map_err(too_large)?;
    Ok(bytes)
}

fn encoder<'a>(bytes: &'a mut Vec<u8>, screen: &Screen) -> Encoder<'static, &'a mut Vec<u8>> {
    let mut encoder = Encoder::new(bytes, screen.width as u32, screen.height as u32);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Balanced);
    // Enlarged pixels repeat the row above.
    encoder.set_filter(Filter::Up);
    encoder
}

fn too_large(error: EncodingError) -> CliError {
    CliError::Usage(format!("the picture cannot be made ({error}): try a smaller --scale, or smaller pictures"))
}

// A picture for people, with drawing operations.

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

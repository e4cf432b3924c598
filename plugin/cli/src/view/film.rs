//! Steps of an episode as PNGs, still or animated.

use bevy_playbot::vision::ImageOptions;
use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, Filter};

use super::{
    caption::{Caption, NARROWEST},
    colours::BACKGROUND,
    episode_world::EpisodeStep,
    numbers::Numbers,
    screen::Screen,
};
use crate::error::CliError;

/// The bytes of a file, and its width and height in pixels.
pub type Png = (Vec<u8>, [usize; 2]);

/// The drawing of the steps of an episode.
pub struct Film {
    content: FilmContent,
    tick_hz: f64,
}

/// The part above the captions.
enum FilmContent {
    /// Pictures of a form, and their enlargement.
    Pictures(ImageOptions, usize),
    Numbers(Numbers),
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
    pub fn of_numbers(numbers: Numbers, tick_hz: f64) -> Self {
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

/// Encodes a PNG file.
///
/// # Errors
///
/// The picture is too large for a PNG.
pub fn to_png(screen: &Screen) -> Result<Vec<u8>, CliError> {
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

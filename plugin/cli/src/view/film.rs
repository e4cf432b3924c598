//! Shots as PNGs: one, or many that move.

use bevy_playbot::vision::ImageOptions;
use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, Filter};

use super::{
    caption::{Caption, NARROWEST},
    screen::{Colour, Screen},
    stage::Shot,
};
use crate::error::CliError;

const BACKGROUND: Colour = [24, 24, 28];

/// The bytes of a file, and its width and height in pixels.
pub type Png = (Vec<u8>, [usize; 2]);

/// How shots are drawn.
pub struct Film {
    options: ImageOptions,
    scale: usize,
    tick_hz: f64,
}

impl Film {
    /// Pictures of this form, each pixel enlarged to a square of `scale` pixels, `tick_hz` of them in a second.
    ///
    /// # Errors
    ///
    /// Such a picture is too large.
    pub fn new(options: ImageOptions, scale: u32, tick_hz: f64) -> Result<Self, CliError> {
        let film = Self { options, scale: scale as usize, tick_hz };
        let [width, height] = film.size();
        Screen::check_size(width, height)?;
        Ok(film)
    }

    /// One observation ([`Observation::image`](bevy_playbot::observation::Observation::image)) and nothing else; stacked pictures side by side, the oldest on the left.
    ///
    /// # Errors
    ///
    /// The picture is too large for a PNG.
    pub fn still(&self, image: &[u8]) -> Result<Png, CliError> {
        let [width, height] = self.size();
        let mut screen = Screen::new(width, height, BACKGROUND)?;
        self.draw(&mut screen, image);
        Ok((to_png(&screen)?, [width, height]))
    }

    /// All shots one after the other, again and again, each with its caption. `drawn` hears each that is done.
    ///
    /// # Errors
    ///
    /// The pictures are too large for a PNG.
    pub fn animated(&self, shots: &[Shot], drawn: impl FnMut()) -> Result<Png, CliError> {
        let [width, height] = self.size();
        let width = width.max(NARROWEST);
        let skills = shots.iter().map(|shot| shot.skill.len()).max().unwrap_or(0);
        let caption = Caption::new(width, skills);
        let mut screen = Screen::new(width, height + caption.height(), BACKGROUND)?;
        let mut bytes = Vec::new();
        self.encode(&mut bytes, &mut screen, shots, &caption, drawn).map_err(too_large)?;
        Ok((bytes, [screen.width, screen.height]))
    }

    fn encode(
        &self,
        bytes: &mut Vec<u8>,
        screen: &mut Screen,
        shots: &[Shot],
        caption: &Caption,
        mut drawn: impl FnMut(),
    ) -> Result<(), EncodingError> {
        let top = self.size()[1];
        let mut encoder = encoder(bytes, screen);
        encoder.set_animated(shots.len() as u32, 0)?;
        let (numerator, denominator) = self.delay();
        encoder.set_frame_delay(numerator, denominator)?;
        let mut writer = encoder.write_header()?;
        for shot in shots {
            screen.block(0, 0, screen.width, screen.height, BACKGROUND);
            self.draw(screen, &shot.image);
            caption.draw(screen, top, shot);
            writer.write_image_data(screen.bytes())?;
            drawn();
        }
        writer.finish()
    }

    /// Seconds that a tick takes, as a fraction.
    fn delay(&self) -> (u16, u16) {
        if self.tick_hz.fract() == 0.0 && self.tick_hz <= f64::from(u16::MAX) {
            (1, self.tick_hz as u16)
        } else {
            ((1000.0 / self.tick_hz).round().clamp(1.0, f64::from(u16::MAX)) as u16, 1000)
        }
    }

    /// Width and height of the enlarged pictures, side by side.
    fn size(&self) -> [usize; 2] {
        let ImageOptions { width, height, stack, .. } = self.options;
        let gaps = (stack as usize - 1) * self.scale;
        [stack as usize * width as usize * self.scale + gaps, height as usize * self.scale]
    }

    fn draw(&self, screen: &mut Screen, image: &[u8]) {
        let (width, height) = (self.options.width as usize, self.options.height as usize);
        let picture = width * height * self.options.colours() as usize;
        for (number, planes) in image.chunks_exact(picture).enumerate() {
            let x = number * (width + 1) * self.scale;
            screen.planes(planes, width, height, self.scale, (x, 0));
        }
    }
}

/// The bytes of a PNG file.
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

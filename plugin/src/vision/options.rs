//! Size and form of the pictures that a policy reads.

use crate::{agent::Agent, carry_over::ReflectCarryComponent, episode::EpisodeEnded, fault::Faults};
use bevy::prelude::*;
use playbot_learner::{HasExitCode, ImageShape, ObsKind, settings, settings::Range};
use thiserror::Error;

/// Largest width and height of a picture, in pixels.
pub const MAX_SIDE: u32 = 1024;

settings! {
    /// Size and form of the pictures that a policy reads.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct ImageOptions in "image", read by &[];

    /// Columns of pixels.
    width: u32 = 64, in Range::Count(MAX_SIDE as u64);
    /// Rows of pixels.
    height: u32 = 64, in Range::Count(MAX_SIDE as u64);
    /// Successive pictures of one observation, oldest first. At the start of an episode the first
    /// picture stands in for the missing ones.
    stack: u32 = 1, in Range::Count(Self::MAX_STACK as u64);
    /// One channel of brightness instead of red, green and blue (ITU-R BT.601 weights).
    grayscale: bool = false;
    /// Paints two squares at the top left, each a fifth of the picture's width, whose grey shows
    /// the agent's velocity, as in the first CoinRun. The game fills
    /// [`PaintedVelocity`].
    paint_velocity: bool = false;
}

/// The reason why pictures cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum VisionError {
    /// A width, height or stack that is 0 or too large.
    #[error("{what} is {value}; it must be 1 to {most}")]
    Size {
        /// The name of the size.
        what: &'static str,
        /// Its value.
        value: u32,
        /// Its largest allowed value.
        most: u32,
    },
    /// The game has nothing to draw.
    #[error("{game} cannot be drawn; use `observation: Vector`")]
    NoPicture {
        /// Name of the game.
        game: &'static str,
    },
    /// No graphics adapter was found.
    #[error(
        "no graphics adapter was found; install a Vulkan driver (Debian's `mesa-vulkan-drivers` needs no GPU), or use \
         `observation: Raster`"
    )]
    NoAdapter,
    /// The program was built without cameras.
    #[error(
        "this program was built without cameras: leave the camera out, or switch on the feature `camera` of `playbot` (for the \
         program `playbot`, `--features camera` behind `cargo build` or `cargo install`)"
    )]
    NoCamera,
}

impl HasExitCode for VisionError {}

impl ImageOptions {
    /// Largest number of pictures in a stack.
    pub const MAX_STACK: u32 = 16;

    /// Checks the sizes.
    ///
    /// # Errors
    ///
    /// [`VisionError::Size`], which names the size.
    pub fn check(&self) -> Result<(), VisionError> {
        let sizes = [
            ("width", self.width, MAX_SIDE),
            ("height", self.height, MAX_SIDE),
            ("stack", self.stack, Self::MAX_STACK),
        ];
        for (what, value, most) in sizes {
            if !(1..=most).contains(&value) {
                return Err(VisionError::Size { what, value, most });
            }
        }
        Ok(())
    }

    /// Returns the rows and columns at the top left in which velocity is painted, if it is.
    pub fn painted_corner(&self) -> Option<[usize; 2]> {
        let edge = |squares| edge_of_squares(squares, self.width as usize);
        self.paint_velocity.then(|| [edge(1).min(self.height as usize), edge(2)])
    }

    /// Channels of one picture: 1 or 3.
    pub fn colours(&self) -> u32 {
        if self.grayscale { 1 } else { 3 }
    }

    /// Returns the shape of an observation: channels are colours times stacked pictures.
    pub fn shape(&self) -> ImageShape {
        ImageShape {
            channels: (self.colours() * self.stack) as usize,
            height: self.height as usize,
            width: self.width as usize,
        }
    }

    /// Returns the shape, for a learner.
    pub fn obs_kind(&self) -> ObsKind {
        ObsKind::Image(self.shape())
    }
}

/// Marks an agent whose policy reads pictures of this size and form. Every sensor of pictures adds
/// it.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
#[require(Frame, BlankEpisodes, PictureStack)]
pub struct ImageSensor(pub ImageOptions);

/// The last picture of an agent's sensor: red, green, blue and an unused byte per pixel, top row
/// first, left to right.
///
/// Filled by a sensor. The options of [`ImageSensor`] (grey, painted velocity,
/// stack) are applied when the observation is made from it.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component)]
pub struct Frame {
    /// `[height, width]` pixels of `[red, green, blue, 255]`.
    pub pixels: Vec<[u8; 4]>,
    /// The tick ([`Tick`](crate::episode::Tick)) of the picture; `None` before the first.
    pub tick: Option<u64>,
}

/// The velocity that [`ImageOptions::paint_velocity`](crate::vision::ImageOptions::paint_velocity) shows, each axis
/// divided by its largest value, from -1 to 1. The game fills it before
/// [`VisionSystems::Compose`](crate::vision::VisionSystems::Compose).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component)]
pub struct PaintedVelocity(pub Vec2);

/// Counts the episodes of an agent in which each picture was of a single colour.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, CarryComponent)]
pub struct BlankEpisodes {
    /// Finished episodes with blank pictures only.
    pub episodes: u64,
    /// True if this episode had a picture, and each was of one colour.
    blank: bool,
    /// True if a picture of this episode was not blank.
    sees: bool,
    /// True if a picture of any episode was not blank.
    has_seen: bool,
}

impl BlankEpisodes {
    /// Notes a picture of the episode. Costs nothing after the first one that is not blank.
    pub(super) fn note(&mut self, pixels: &[[u8; 4]], starts: bool) {
        if starts {
            self.sees = false;
        }
        if !self.sees {
            self.sees = pixels.iter().any(|pixel| pixel != &pixels[0]);
            self.has_seen |= self.sees;
            self.blank = !self.sees;
        }
    }
}

/// Reports an agent with only blank pictures in its first episodes: its sensor looks at nothing
/// that is drawn. For an agent with earlier pictures the level may be the cause, so it gets one
/// warning.
pub(super) fn report_blank(
    event: On<EpisodeEnded>,
    mut sensors: Query<(&Agent, &mut BlankEpisodes)>,
    mut faults: ResMut<Faults>,
) {
    let Ok((agent, mut sensor)) = sensors.get_mut(event.entity) else { return };
    if !std::mem::take(&mut sensor.blank) {
        return;
    }
    sensor.episodes += 1;
    let what = format!(
        "agent {}, level {}: each picture of an episode of {} ticks was of a single colour; point its sensor at something \
         that is drawn",
        agent.index, event.level, event.ticks
    );
    if !sensor.has_seen {
        faults.report(what);
    } else if sensor.episodes == 1 {
        tracing::warn!("{what}");
    }
}

/// The last pictures of an agent's episode, in a ring. A state that is observed twice counts once.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(Component)]
pub(crate) struct PictureStack {
    ring: Vec<u8>,
    /// Bytes of a picture.
    size: usize,
    newest: usize,
    shown: Option<PictureKey>,
}

impl PictureStack {
    /// Adds the picture of a moment, which `paint` writes, and writes all pictures, oldest first.
    pub(super) fn push(&mut self, moment: PictureKey, count: usize, paint: impl FnOnce(&mut [u8]), out: &mut [u8]) {
        let size = out.len() / count;
        let goes_on = self.goes_on(moment) && (self.size, self.ring.len()) == (size, out.len());
        if !goes_on {
            self.size = size;
            self.ring.resize(out.len(), 0);
            self.newest = 0;
        } else if self.shown != Some(moment) {
            self.newest = (self.newest + 1) % count;
        }
        self.shown = Some(moment);
        let from = self.newest * size;
        paint(&mut self.ring[from..from + size]);
        if !goes_on {
            (1..count).for_each(|copy| self.ring.copy_within(..size, copy * size));
        }
        let oldest = (self.newest + 1) % count * size;
        let (wrapped, first) = self.ring.split_at(oldest);
        out[..first.len()].copy_from_slice(first);
        out[first.len()..].copy_from_slice(wrapped);
    }

    /// Returns whether the moment belongs to the episode of the last one. The first moment always
    /// starts anew.
    fn goes_on(&self, moment: PictureKey) -> bool {
        self.shown.is_some_and(|last| {
            (last.episode, last.level) == (moment.episode, moment.level) && moment.tick > 0 && moment.tick >= last.tick
        })
    }
}

/// The state of the game that a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect)]
pub(super) struct PictureKey {
    /// Number of the episode of this agent.
    pub episode: u64,
    /// Its level.
    pub level: u64,
    /// Tick of the episode.
    pub tick: u32,
}

// Conversion of a frame's pixels to the bytes that a policy reads.

/// Weights of red, green and blue in brightness (ITU-R BT.601), in 65536ths.
const BRIGHTNESS: [u32; 3] = [19595, 38470, 7471];

/// Writes a frame as `[colours, height, width]`.
pub(super) fn write_planes(pixels: &[[u8; 4]], options: &ImageOptions, out: &mut [u8]) {
    if options.grayscale {
        for (byte, pixel) in out.iter_mut().zip(pixels) {
            *byte = brightness(*pixel);
        }
        return;
    }
    for (colour, plane) in out.chunks_exact_mut(pixels.len()).enumerate() {
        for (byte, pixel) in plane.iter_mut().zip(pixels) {
            *byte = (u32::from_le_bytes(*pixel) >> (8 * colour)) as u8;
        }
    }
}

/// Returns the brightness, rounded to the nearest.
fn brightness([red, green, blue, _]: [u8; 4]) -> u8 {
    let [r, g, b] = BRIGHTNESS;
    ((r * u32::from(red) + g * u32::from(green) + b * u32::from(blue) + 0x8000) >> 16) as u8
}

/// Returns the columns of this many squares side by side. A pixel belongs to the square that
/// contains its centre.
pub(super) fn edge_of_squares(squares: usize, width: usize) -> usize {
    (2 * squares * width + 5) / 10
}

/// Paints two squares at the top left, each a fifth of the width, whose grey shows the velocity:
/// black for -1, white for 1. Grey keeps its value when converted to brightness, so the order of
/// the two steps is irrelevant.
pub(super) fn paint_velocity(velocity: [f32; 2], options: &ImageOptions, planes: &mut [u8]) {
    let (width, height) = (options.width as usize, options.height as usize);
    let edge = |squares: usize| edge_of_squares(squares, width);
    for (square, speed) in velocity.into_iter().enumerate() {
        let grey = (255.0 * (0.5 * speed.clamp(-1.0, 1.0) + 0.5)) as u8;
        for plane in planes.chunks_exact_mut(width * height) {
            for row in plane.chunks_exact_mut(width).take(edge(1)) {
                row[edge(square)..edge(square + 1)].fill(grey);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_become_planes() {
        let options = ImageOptions { width: 2, height: 1, ..Default::default() };
        let mut out = [0; 6];
        write_planes(&[[1, 2, 3, 255], [10, 20, 30, 255]], &options, &mut out);
        assert_eq!(out, [1, 10, 2, 20, 3, 30]);
    }

    #[test]
    fn brightness_has_the_weights_of_bt_601() {
        let options = ImageOptions { width: 5, height: 1, grayscale: true, ..Default::default() };
        let pixels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [200, 100, 50, 255], [77, 77, 77, 255]];
        let mut out = [0; 5];
        write_planes(&pixels, &options, &mut out);
        // 76.245, 149.685, 29.07 and 124.2.
        assert_eq!(out, [76, 150, 29, 124, 77]);
    }

    #[test]
    fn velocity_is_two_grey_squares() {
        let options = ImageOptions { paint_velocity: true, ..Default::default() };
        let mut planes = vec![7; 3 * 64 * 64];
        paint_velocity([0.2, 0.0], &options, &mut planes);
        for plane in planes.chunks(64 * 64) {
            let at = |x: usize, y: usize| plane[y * 64 + x];
            // The squares have a side of 12.8 pixels.
            assert_eq!([at(0, 0), at(12, 12), at(13, 0), at(25, 12)], [153, 153, 127, 127]);
            assert_eq!([at(26, 0), at(0, 13), at(25, 13)], [7; 3]);
            assert_eq!(options.painted_corner(), Some([13, 26]));
        }
        paint_velocity([-9.0, 9.0], &options, &mut planes);
        assert_eq!([planes[0], planes[20]], [0, 255], "no faster than the fastest");
    }

    #[test]
    fn velocity_fits_pictures_that_are_wide_and_low() {
        let options = ImageOptions { width: 9, height: 1, paint_velocity: true, ..Default::default() };
        let mut planes = vec![7; 3 * 9];
        paint_velocity([1.0, -1.0], &options, &mut planes);
        assert_eq!(planes[..9], [255, 255, 0, 0, 7, 7, 7, 7, 7]);
    }

    fn shown(stack: &mut PictureStack, episode: u64, tick: u32, picture: u8) -> [u8; 6] {
        let mut out = [0; 6];
        stack.push(PictureKey { episode, level: 0, tick }, 3, |bytes| bytes.fill(picture), &mut out);
        out
    }

    #[test]
    fn oldest_comes_first_and_the_first_picture_stands_in() {
        let stack = &mut PictureStack::default();
        assert_eq!(shown(stack, 0, 0, 1), [1; 6]);
        assert_eq!(shown(stack, 0, 1, 2), [1, 1, 1, 1, 2, 2]);
        assert_eq!(shown(stack, 0, 2, 3), [1, 1, 2, 2, 3, 3]);
        assert_eq!(shown(stack, 0, 3, 4), [2, 2, 3, 3, 4, 4]);
        assert_eq!(shown(stack, 1, 0, 5), [5; 6], "another episode");
    }

    #[test]
    fn a_state_counts_once() {
        let stack = &mut PictureStack::default();
        shown(stack, 0, 0, 1);
        shown(stack, 0, 1, 2);
        assert_eq!(shown(stack, 0, 1, 3), [1, 1, 1, 1, 3, 3], "only the newest is replaced");
        assert_eq!(shown(stack, 0, 2, 4), [1, 1, 3, 3, 4, 4]);
        shown(stack, 0, 0, 6);
        assert_eq!(shown(stack, 0, 0, 7), [7; 6], "an episode left in its first tick and begun again");
    }

    #[test]
    fn looking_from_the_middle_on_starts_anew() {
        let stack = &mut PictureStack::default();
        assert_eq!(shown(stack, 0, 5, 1), [1; 6]);
        assert_eq!(shown(stack, 2, 9, 2), [2; 6]);
    }
}

//! Size and form of the pictures that a policy reads.

use bevy::prelude::*;
use playbot_learner::{HasExitCode, ImageShape, ObsKind, settings, settings::Range};
use thiserror::Error;

use super::{Frame, blank::BlankEpisodes, planes::edge_of_squares, stack::PictureStack};

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
    /// [`PaintedVelocity`](super::PaintedVelocity).
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
        "this program was built without cameras: switch on the feature `camera` of `playbot_cli` or `playbot_lab` \
         (`--features camera` in the program `playbot`), or use another `observation`"
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

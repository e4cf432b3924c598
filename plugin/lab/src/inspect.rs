//! Looking at single levels and at single steps: what a game can show of itself.

use std::path::Path;

use bevy_playbot::{
    fault::Fault,
    unknown_name::UnknownName,
    vision::{ImageOptions, VisionError},
};
use thiserror::Error;

use crate::{drawing::Drawing, mode::ModeError};

/// The game cannot show that.
#[derive(Debug, Error)]
pub enum InspectError {
    /// What was asked for does not exist, in words that say what to do.
    #[error("{0}")]
    Usage(String),
    /// There is no such name.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// There is no such mode.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The picture cannot be made.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// Nobody takes the lines any more.
    #[error("nobody reads the output")]
    Closed,
}

/// Which level is to be shown.
#[derive(Clone, Copy, Debug, Default)]
pub struct LevelRequest<'a> {
    /// Mode, if one is named.
    pub mode: Option<&'a str>,
    /// Map, for games whose levels are maps: a name, a whole mode, or a file.
    pub map: Option<&'a str>,
    /// File with a level in the game's own format, if one is named.
    pub file: Option<&'a Path>,
    /// Seed, if one is named.
    pub seed: Option<u64>,
    /// Whether a picture is wanted too.
    pub picture: bool,
}

/// A level for people and programs.
#[derive(Clone, Debug)]
pub struct LevelView {
    /// Lines for people.
    pub text: String,
    /// One line of JSON.
    pub json: String,
    /// The whole level, if it was asked for.
    pub picture: Option<LevelPicture>,
}

/// A whole level as a picture.
#[derive(Clone, Debug)]
pub enum LevelPicture {
    /// Pixels, as an agent would see them that sees all of it:
    /// [`Observation::image`](bevy_playbot::observation::Observation::image).
    Pixels {
        /// Form of the image.
        image: ImageOptions,
        /// Its values.
        pixels: Vec<u8>,
    },
    /// Lines and areas.
    Drawing(Drawing),
}

/// Which actions are to be played, and where.
#[derive(Clone, Copy, Debug, Default)]
pub struct TraceRequest<'a> {
    /// Mode; the game's last one if none is named.
    pub mode: Option<&'a str>,
    /// Seed of the level.
    pub seed: u64,
    /// Where to start instead of where the level says; empty for there.
    pub start: &'a [f64],
    /// Discrete actions.
    pub actions: &'a [u32],
    /// File of actions, instead.
    pub file: Option<&'a Path>,
    /// One line of JSON per step; else a table.
    pub json: bool,
}

/// Takes one line of output.
pub type Print<'a> = &'a mut dyn FnMut(String) -> Result<(), InspectError>;

/// The text of a file.
///
/// # Errors
///
/// It cannot be read.
pub fn read_text(path: &Path) -> Result<String, InspectError> {
    let read = std::fs::read_to_string(path);
    read.map_err(|error| {
        InspectError::Usage(format!(
            "cannot read {}: {error}; name a file that is there and may be read",
            path.display()
        ))
    })
}

/// The shortest decimal that reads back as the same number; whole numbers without a point, and no negative zero.
pub fn plain<T: std::fmt::Display + std::ops::Add<Output = T> + Default>(value: T) -> String {
    format!("{}", value + T::default())
}

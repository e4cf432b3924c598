//! Views of single levels and single steps.

use crate::{
    drawing::Drawing,
    level_files::read::{TextFileError, read_text_file, shown_path},
    mode::ModeError,
};
use bevy::prelude::*;
use bevy_playbot::{
    fault::Fault,
    unknown_name::UnknownName,
    vision::{ImageOptions, VisionError},
};
use playbot_learner::HasExitCode;
use std::{borrow::Cow, path::Path};
use thiserror::Error;

/// A view that the game cannot give.
#[derive(Debug, Error)]
pub enum InspectError {
    /// An invalid request, with its remedy.
    #[error("{0}")]
    Usage(String),
    /// An unknown name.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// An invalid mode.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The picture cannot be made.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The output is closed.
    #[error("the output is closed: nothing reads it")]
    Closed,
}

impl HasExitCode for InspectError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Fault(_) | Self::Closed => 2,
            Self::Usage(_) | Self::Name(_) | Self::Mode(_) | Self::Vision(_) => 3,
        }
    }
}

/// The level to show.
#[derive(Clone, Copy, Debug, Default)]
pub struct LevelRequest<'a> {
    /// Mode, if one is named.
    pub mode: Option<&'a str>,
    /// Map, for games whose levels are maps: a name, a whole mode, or a file.
    pub map: Option<&'a str>,
    /// File with a level in the game's own format, if one is named; `-` is standard input.
    pub file: Option<&'a Path>,
    /// Number of the level, if one is named.
    pub level: Option<u64>,
    /// True if a picture is wanted too.
    pub picture: bool,
}

/// A level for people and programs.
#[derive(Clone, Debug)]
pub struct LevelView {
    /// Lines for people.
    pub text: String,
    /// One line of JSON.
    pub json: String,
    /// True if a plan of the level could be shown, and the game has none.
    pub lacks_plan: bool,
    /// The whole level, if it was asked for.
    pub picture: Option<LevelPicture>,
}

/// A whole level as a picture.
#[derive(Clone, Debug)]
pub enum LevelPicture {
    /// Pixels as seen by an agent that sees the whole level:
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

/// Actions to play, and the level to play them on.
#[derive(Clone, Copy, Debug, Default)]
pub struct TraceRequest<'a> {
    /// Mode; the game's last one if none is named.
    pub mode: Option<&'a str>,
    /// Number of the level.
    pub level: u64,
    /// Start instead of the level's own; empty for the level's own.
    pub start: &'a [f64],
    /// Discrete actions.
    pub actions: &'a [u32],
    /// File of actions, instead; `-` is standard input.
    pub file: Option<&'a Path>,
    /// True for one line of JSON per step, false for a table.
    pub json: bool,
}

/// Callback that takes one line of output.
pub type Print<'a> = &'a mut dyn FnMut(String) -> Result<(), InspectError>;

/// Largest size of a file that is shown, bytes.
const MOST_BYTES: u64 = 32 << 20;

/// Reads a text file, or standard input for the path `-`.
///
/// # Errors
///
/// The file cannot be read.
pub fn read_text(path: &Path) -> Result<String, InspectError> {
    read_text_file(path, MOST_BYTES).map_err(|error| {
        let next = match error {
            TextFileError::Unreadable(_) | TextFileError::NotAFile => "; name an existing file that you may read",
            // They say what to do.
            TextFileError::TooLarge { .. } | TextFileError::Utf16(_) | TextFileError::NoText { .. } => "",
        };
        InspectError::Usage(format!("cannot read {}: {error}{next}", shown_path(path)))
    })
}

/// Formats a number as the shortest decimal that reads back as the same number: whole numbers without a point, and no
/// negative zero.
pub fn plain<T: std::fmt::Display + std::ops::Add<Output = T> + Default>(value: T) -> String {
    format!("{}", value + T::default())
}

/// An experiment in RON that comes with a game.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExperimentText {
    /// The origin, for messages: the path of its file below the game's sources, or words.
    pub origin: Cow<'static, str>,
    /// Its text.
    pub text: Cow<'static, str>,
}

/// Component of an agent: the entity that a 3D camera follows.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub struct CameraFocus(pub Entity);

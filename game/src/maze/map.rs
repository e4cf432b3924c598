//! The map of a mode: one of the fixed ones, or a generated one for each seed.

use bevy_playbot::game::UnknownName;

use super::{error::MazeError, fixed, generator::generate, layout::Maze, spec::MazeSpec, spec_text::OptionError};

/// Where the mazes of a mode come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Map {
    /// D4RL's `U`, 5 x 5 cells.
    Umaze,
    /// 8 x 8 cells.
    Medium,
    /// 9 x 12 cells.
    Large,
    /// 16 x 22 cells.
    Xl,
    /// Another maze for each seed.
    Random(MazeSpec),
}

impl Map {
    /// Names of the maps; each is a mode of the maze games.
    pub const NAMES: [&'static str; 5] = ["umaze", "medium", "large", "xl", "random"];

    /// The map with this name; `random` has the usual spec.
    ///
    /// # Errors
    ///
    /// [`UnknownName`] with the valid names.
    pub fn named(name: &str) -> Result<Self, UnknownName> {
        match name {
            "umaze" => Ok(Self::Umaze),
            "medium" => Ok(Self::Medium),
            "large" => Ok(Self::Large),
            "xl" => Ok(Self::Xl),
            "random" => Ok(Self::Random(MazeSpec::default())),
            _ => Err(UnknownName::new("map", name, &Self::NAMES)),
        }
    }

    /// Its name, without options.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Umaze => "umaze",
            Self::Medium => "medium",
            Self::Large => "large",
            Self::Xl => "xl",
            Self::Random(_) => "random",
        }
    }

    /// Takes one option `key=value` of a mode; false if this map has no such option. Only generated mazes have any.
    ///
    /// # Errors
    ///
    /// The value cannot be read.
    pub fn set_option(&mut self, key: &str, value: &str) -> Result<bool, OptionError> {
        match self {
            Self::Random(spec) => spec.set_option(key, value),
            _ => Ok(false),
        }
    }

    /// The options that differ from the default, each `key=value`.
    pub fn options(&self) -> Vec<String> {
        match self {
            Self::Random(spec) => spec.options(),
            _ => Vec::new(),
        }
    }

    /// Options that this map takes, each with an example of a value.
    pub fn valid_options(&self) -> &'static [&'static str] {
        match self {
            Self::Random(_) => &MazeSpec::OPTIONS,
            _ => &[],
        }
    }

    /// Checks that there can be such a maze: call it when all options have been taken.
    ///
    /// # Errors
    ///
    /// [`MazeError`] names the value that cannot be.
    pub fn check(&self) -> Result<(), MazeError> {
        match self {
            Self::Random(spec) => spec.check(),
            _ => Ok(()),
        }
    }

    /// The maze as Maze2D has it. Only a generated one depends on the seed.
    ///
    /// # Errors
    ///
    /// No maze can be generated from the spec.
    pub fn maze2d(&self, seed: u64) -> Result<Maze, MazeError> {
        Ok(match self {
            Self::Umaze => fixed::maze2d::umaze(),
            Self::Medium => fixed::maze2d::medium(),
            Self::Large => fixed::maze2d::large(),
            Self::Xl => fixed::maze2d::xl(),
            Self::Random(spec) => generate(spec, seed)?,
        })
    }

    /// The maze as AntMaze has it. Only a generated one depends on the seed.
    ///
    /// # Errors
    ///
    /// No maze can be generated from the spec.
    pub fn antmaze(&self, seed: u64) -> Result<Maze, MazeError> {
        Ok(match self {
            Self::Umaze => fixed::antmaze::umaze(),
            Self::Medium => fixed::antmaze::medium(),
            Self::Large => fixed::antmaze::large(),
            Self::Xl => fixed::antmaze::xl(),
            Self::Random(spec) => generate(spec, seed)?,
        })
    }
}

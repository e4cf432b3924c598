//! The map of a mode: one of the fixed ones, or a generated one for each seed.

use crate::maze::{
    Maze,
    error::MazeError,
    generator::{MazeModeError, MazeSpec, OptionError, generate},
};
use bevy_playbot::unknown_name::UnknownName;
use std::{fmt, str::FromStr};

/// The source of a mode's mazes.
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

    /// Returns the map with this name; `random` has the default spec.
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

    /// Takes one option `key=value` of a mode; false if this map has no such option. Only generated mazes have options.
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

    /// Returns the options that differ from the default, each `key=value`.
    pub fn options(&self) -> Vec<String> {
        match self {
            Self::Random(spec) => spec.options(),
            _ => Vec::new(),
        }
    }

    /// Returns the shared family of all specs: one seed draws related mazes.
    pub fn family(&self) -> Option<String> {
        matches!(self, Self::Random(_)).then(|| self.name().to_owned())
    }

    /// Returns a hash of a generated maze's walls. Returns `None` for a fixed map and for an impossible spec.
    pub fn fingerprint(&self, seed: u64) -> Option<u64> {
        match self {
            Self::Random(spec) => Some(generate(spec, seed).ok()?.fingerprint()),
            _ => None,
        }
    }

    /// Options that this map takes, each with an example of a value.
    pub fn valid_options(&self) -> &'static [&'static str] {
        match self {
            Self::Random(_) => &MazeSpec::OPTIONS,
            _ => &[],
        }
    }

    /// Returns the error of an option that neither this map nor the game takes; `of_game` lists the game's.
    pub fn unknown_option(&self, option: &str, of_game: &[&str]) -> UnknownName {
        UnknownName::new("option", option, &[of_game, self.valid_options()].concat())
    }

    /// Checks that such a maze is possible, after all options have been taken.
    ///
    /// # Errors
    ///
    /// [`MazeError`] names the impossible value.
    pub fn check(&self) -> Result<(), MazeError> {
        match self {
            Self::Random(spec) => spec.check(),
            _ => Ok(()),
        }
    }

    /// Returns the maze for Maze2D. Only a generated one depends on the seed.
    ///
    /// # Errors
    ///
    /// No maze can be generated from the spec.
    pub fn maze2d(&self, seed: u64) -> Result<Maze, MazeError> {
        Ok(match self {
            Self::Umaze => crate::maze::fixed::maze2d::umaze(),
            Self::Medium => crate::maze::fixed::maze2d::medium(),
            Self::Large => crate::maze::fixed::maze2d::large(),
            Self::Xl => crate::maze::fixed::maze2d::xl(),
            Self::Random(spec) => generate(spec, seed)?,
        })
    }

    /// Returns the maze for AntMaze. Only a generated one depends on the seed.
    ///
    /// # Errors
    ///
    /// No maze can be generated from the spec.
    pub fn antmaze(&self, seed: u64) -> Result<Maze, MazeError> {
        Ok(match self {
            Self::Umaze => crate::maze::fixed::antmaze::umaze(),
            Self::Medium => crate::maze::fixed::antmaze::medium(),
            Self::Large => crate::maze::fixed::antmaze::large(),
            Self::Xl => crate::maze::fixed::antmaze::xl(),
            Self::Random(spec) => generate(spec, seed)?,
        })
    }
}

impl FromStr for Map {
    type Err = MazeModeError;

    /// Parses a name with the map's options behind it: `medium`, `random+size=9x9+loops=0.2`.
    fn from_str(text: &str) -> Result<Self, MazeModeError> {
        let mut words = text.split('+');
        let mut map = Self::named(words.next().unwrap_or_default())?;
        for word in words {
            let (key, value) = word.split_once('=').unwrap_or((word, ""));
            if !map.set_option(key, value)? {
                return Err(UnknownName::new("map option", word, map.valid_options()).into());
            }
        }
        map.check()?;
        Ok(map)
    }
}

impl fmt::Display for Map {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        self.options().iter().try_for_each(|option| write!(f, "+{option}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_back_without_defaults() {
        for text in ["medium", "random", "random+size=9x13+loops=0.25+corridor=2+difficulty=5..8"] {
            assert_eq!(text.parse::<Map>().expect("a map").to_string(), text);
        }
        assert_eq!("random+size=11x11+loops=0.10".parse::<Map>().expect("a map").to_string(), "random");
        let one: Map = "random+difficulty=7".parse().expect("a map");
        assert_eq!(one.to_string(), "random+difficulty=7..7");
    }

    #[test]
    fn what_cannot_be_read_says_what_can() {
        let error = |text: &str| text.parse::<Map>().expect_err("no map").to_string();
        assert!(error("medum").contains("did you mean `medium`"), "{}", error("medum"));
        assert!(error("random+lops=0.1").contains("did you mean `loops=0.2`"), "{}", error("random+lops=0.1"));
        assert_eq!(error("medium+loops=0.1"), "unknown map option `loops=0.1`; there is none here");
        assert!(error("random+size=9").contains("rows x columns"));
        assert!(error("random+size=9x5000").contains("too large"));
        assert!(error("random+size=4x9").contains("`size=4x9` has no room"));
        assert!(error("random+size=0x0").contains("`size=0x0` has no room"));
        assert!(error("random+corridor=0").contains("at least 1"));
        assert!(error("random+loops=1.5").contains("between 0 and 1"));
        assert!(error("random+loops=NaN").contains("between 0 and 1"));
        assert!(error("random+difficulty=9..3").contains("fewest and the most"));
    }
}

//! Named ranges of levels.

use crate::{
    game::{Game, level_designs},
    level_files::{LevelFileError, find_level_files, is_level_files, level_file_pattern},
    mode::ModeError,
};
use playbot_learner::HasExitCode;
use serde::{Deserialize, Serialize};
use std::{fmt, num::IntErrorKind, str::FromStr};
use thiserror::Error;

/// Largest number of levels in a split: more would not fit in memory as a list.
const MAX_LEVELS: u64 = 1 << 24;

/// Levels `first..=last` of one mode of a game. Written `hard:64..127`, both ends included.
///
/// Levels from files are written `files:levels/**/*.json`, which counts the matching files when it is read. A range
/// may follow: `files:levels/**/*.json:0..9`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct LevelSplit {
    /// Mode of the game, such as `easy` or `hard`.
    pub mode: String,
    /// First level.
    pub first: u64,
    /// Last level, included.
    pub last: u64,
}

impl LevelSplit {
    /// Creates the split of a single level.
    pub fn one(mode: impl Into<String>, level: u64) -> Self {
        Self { mode: mode.into(), first: level, last: level }
    }

    /// Returns the number of levels, at least 1.
    pub fn len(&self) -> u64 {
        self.last - self.first + 1
    }

    /// Returns false: a split has at least one level.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Iterates over all levels in order.
    pub fn levels(&self) -> impl Iterator<Item = u64> + use<> {
        self.first..=self.last
    }

    /// Returns whether it has this level of this mode.
    pub fn contains(&self, mode: &str, level: u64) -> bool {
        self.mode == mode && (self.first..=self.last).contains(&level)
    }

    /// Checks that a game has all of these levels, and reads those from files.
    ///
    /// # Errors
    ///
    /// [`ModeError`] with the valid values.
    pub fn check(&self, game: &dyn Game) -> Result<(), ModeError> {
        game.check_mode(&self.mode)?;
        check_level(game, &self.mode, self.last)
    }

    /// Returns the levels of a default range that the game has. If it has none of them, they are all of its levels, or as
    /// many of the first as the range has.
    #[must_use]
    pub fn within(self, game: &dyn Game) -> Self {
        let last = last_level(game, &self.mode).unwrap_or(u64::MAX);
        if self.first <= last {
            return Self { last: self.last.min(last), ..self };
        }
        Self { first: 0, last: last.min(self.len() - 1), ..self }
    }

    /// Returns the fewest ranges that hold exactly these levels of a mode, which ascend.
    pub fn ranges(mode: &str, levels: &[u64]) -> Vec<Self> {
        let runs = levels.chunk_by(|one, next| one + 1 == *next);
        let range = |run: &[u64]| Some(Self { mode: mode.to_owned(), first: *run.first()?, last: *run.last()? });
        runs.filter_map(range).collect()
    }

    /// Returns whether a level belongs to both.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.mode == other.mode && self.first <= other.last && other.first <= self.last
    }
}

impl fmt::Display for LevelSplit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}..{}", self.mode, self.first, self.last)
    }
}

/// Checks that a [valid](Game::check_mode) mode has a level, and reads levels from files.
///
/// # Errors
///
/// [`ModeError`] with the last level of the mode.
pub fn check_level(game: &dyn Game, mode: &str, level: u64) -> Result<(), ModeError> {
    let mode = mode.to_owned();
    if is_level_files(&mode) {
        let count = level_designs(game, &mode)?.count();
        return if level < count { Ok(()) } else { Err(LevelFileError::NoLevel { mode, level, count }.into()) };
    }
    match last_level(game, &mode) {
        Some(last) if level > last => Err(ModeError::NoLevel { game: game.name().to_owned(), mode, level, last }),
        _ => Ok(()),
    }
}

/// Returns the number of the last level of the game's own; `None` for level files, and if every number is valid.
pub fn last_level(game: &dyn Game, mode: &str) -> Option<u64> {
    game.tools().levels.last_level().filter(|_| !is_level_files(mode))
}

/// Returns the level files that a text with a misspelt prefix means, such as `file:levels/*.json`.
fn misspelt_files(text: &str) -> Option<&str> {
    let (prefix, pattern) = text.split_once(':')?;
    let is_misspelt = ["file", "files"].iter().any(|word| prefix.eq_ignore_ascii_case(word)) && !is_level_files(text);
    // As addresses of files have it.
    is_misspelt.then(|| pattern.strip_prefix("//").unwrap_or(pattern))
}

/// Returns the level files that a text probably means.
fn files_like(text: &str) -> &str {
    if text.ends_with(".json") { text } else { "levels/*.json" }
}

/// Text that is not a valid split.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum SplitError {
    /// The text has another form.
    #[error(
        "`{}` is not a range of levels: write mode:first..last, both ends included, such as hard:64..127, or name level files, \
         as in files:{}", .0, files_like(.0)
    )]
    NotARange(String),
    /// The prefix of level files is misspelt.
    #[error(
        "`{text}` is not a range of levels: levels from files begin with `files:`; did you mean `files:{pattern}`?"
    )]
    MisspeltFiles {
        /// The text.
        text: String,
        /// The pattern behind the prefix.
        pattern: String,
    },
    /// A number of the range is too large.
    #[error("`{0}` is not a level: numbers go up to 18,446,744,073,709,551,615")]
    TooLarge(String),
    /// The range goes backwards.
    #[error("`{text}`: first level {first} is after last level {last}; write {mode}:{last}..{first}")]
    Reversed {
        /// The text.
        text: String,
        /// Mode of the range.
        mode: String,
        /// First level of the range.
        first: u64,
        /// Last level of the range.
        last: u64,
    },
    /// Too many levels.
    #[error("`{0}` has too many levels: a range has at most 16,777,216")]
    TooMany(String),
    /// Missing level files.
    #[error(transparent)]
    Files(#[from] LevelFileError),
}

impl HasExitCode for SplitError {}

/// Parses `4..9` or `4`.
fn range(text: &str) -> Option<(u64, u64)> {
    let (first, last) = text.split_once("..").unwrap_or((text, text));
    Some((first.parse().ok()?, last.parse().ok()?))
}

/// Returns the first number of a range that is larger than every level.
fn too_large(text: &str) -> Option<&str> {
    let (_, levels) = text.rsplit_once(':')?;
    let (first, last) = levels.split_once("..").unwrap_or((levels, levels));
    let is_large =
        |number: &&str| matches!(number.parse::<u64>(), Err(error) if *error.kind() == IntErrorKind::PosOverflow);
    [first, last].into_iter().find(is_large)
}

impl FromStr for LevelSplit {
    type Err = SplitError;

    fn from_str(text: &str) -> Result<Self, SplitError> {
        let parse = || {
            let (mode, levels) = if is_level_files(text) { text.rsplit_once(':') } else { text.split_once(':') }?;
            let (first, last) = range(levels)?;
            let is_whole = !mode.is_empty() && is_level_files(mode) == is_level_files(text);
            is_whole.then(|| (mode.to_owned(), first, last))
        };
        if let (Some(pattern), None) = (level_file_pattern(text), parse()) {
            let count = find_level_files(pattern)?.len() as u64;
            return Ok(Self { mode: text.to_owned(), first: 0, last: count - 1 });
        }
        let (mode, first, last) = parse().ok_or_else(|| match (too_large(text), misspelt_files(text)) {
            (Some(number), _) => SplitError::TooLarge(number.to_owned()),
            (None, Some(pattern)) => SplitError::MisspeltFiles { text: text.to_owned(), pattern: pattern.to_owned() },
            (None, None) => SplitError::NotARange(text.to_owned()),
        })?;
        if first > last {
            return Err(SplitError::Reversed { text: text.to_owned(), mode, first, last });
        }
        if last - first >= MAX_LEVELS {
            return Err(SplitError::TooMany(text.to_owned()));
        }
        Ok(Self { mode, first, last })
    }
}

impl TryFrom<String> for LevelSplit {
    type Error = SplitError;

    fn try_from(text: String) -> Result<Self, SplitError> {
        text.parse()
    }
}

impl From<LevelSplit> for String {
    fn from(split: LevelSplit) -> Self {
        split.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreign::ForeignGame;
    use bevy::prelude::App;

    #[test]
    fn text_form_reads_back() {
        let split: LevelSplit = "hard:64..127".parse().expect("a split");
        assert_eq!((split.first, split.last, split.len()), (64, 127, 64));
        assert_eq!(split.to_string(), "hard:64..127");
        assert_eq!("easy:7".parse::<LevelSplit>().expect("one level").len(), 1);
        for bad in ["", "hard", "hard:9..3", ":1..2", "hard:a..b", "hard:-1..2", "easy:0..18446744073709551615"] {
            assert!(bad.parse::<LevelSplit>().is_err(), "{bad} was taken");
        }
        let words = |text: &str| text.parse::<LevelSplit>().expect_err("no split").to_string();
        assert_eq!(words("easy:9..3"), "`easy:9..3`: first level 9 is after last level 3; write easy:3..9");
        assert!(words("easy:0..16777216").contains("at most 16,777,216"));
        assert_eq!(
            words("easy:0..18446744073709551616"),
            "`18446744073709551616` is not a level: numbers go up to 18,446,744,073,709,551,615"
        );
        assert_eq!("easy:0..16777215".parse::<LevelSplit>().expect("just as many").len(), MAX_LEVELS);
    }

    #[test]
    fn files_are_counted_unless_there_are_numbers_behind_them() {
        let split: LevelSplit = "files:no/such/*.json:3..9".parse().expect("nothing is looked for");
        assert_eq!((split.mode.as_str(), split.first, split.last), ("files:no/such/*.json", 3, 9));
        assert_eq!(split.to_string(), "files:no/such/*.json:3..9");
        assert_eq!("files:a.json:2".parse::<LevelSplit>().expect("one file").len(), 1);
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["b.json", "a.json"] {
            std::fs::write(folder.path().join(name), "").expect("writable");
        }
        let text = format!("files:{}/*.json", folder.path().display());
        let counted: LevelSplit = text.parse().expect("two files");
        assert_eq!(counted.to_string(), format!("{text}:0..1"));
        assert_eq!(counted.to_string().parse(), Ok(counted));
        let words = "files:no/such/*.json".parse::<LevelSplit>().expect_err("no files").to_string();
        assert!(words.contains("files:no/such/*.json matches no file"), "{words}");
        assert!("files:a.json:9..3".parse::<LevelSplit>().is_err());
        for (text, meant) in [
            ("file:levels/*.json", "files:levels/*.json"),
            ("Files:a.json", "files:a.json"),
            ("file:///tmp/a.json", "files:/tmp/a.json"),
        ] {
            let words = text.parse::<LevelSplit>().expect_err("misspelt").to_string();
            assert!(words.starts_with(&format!("`{text}` is not")), "{words}");
            assert!(words.ends_with(&format!("did you mean `{meant}`?")), "{words}");
        }
        assert_eq!("file:3".parse::<LevelSplit>().expect("a mode may have this name").mode, "file");
    }

    #[test]
    fn default_ranges_end_with_the_last_level_of_the_game() {
        let game = |count| ForeignGame::new("rooms", 1, |_: &mut App| {}).levels(count);
        let within =
            |text: &str, game: &ForeignGame| text.parse::<LevelSplit>().expect("a split").within(game).to_string();
        for (text, count, wanted) in [
            ("default:0..63", 240, "default:0..63"),
            ("default:0..499", 240, "default:0..239"),
            ("default:64..127", 100, "default:64..99"),
            ("default:64..127", 8, "default:0..7"),
            ("default:1000..1003", 8, "default:0..3"),
            ("default:0..63", 1, "default:0..0"),
        ] {
            assert_eq!(within(text, &game(count)), wanted);
        }
        let endless = ForeignGame::new("rooms", 1, |_: &mut App| {});
        assert_eq!(within("default:1000..1003", &endless), "default:1000..1003");
        assert_eq!(within("files:a/*.json:3..9", &game(2)), "files:a/*.json:3..9");
    }

    #[test]
    fn levels_past_the_last_one_are_refused_with_the_levels_that_there_are() {
        let game = |count| ForeignGame::new("rooms", 1, |_: &mut App| {}).levels(count);
        let check = |text: &str, count| {
            text.parse::<LevelSplit>().expect("a split").check(&game(count)).map_err(|error| error.to_string())
        };
        assert_eq!(check("default:0..7", 8), Ok(()));
        let words = "level 8 of `default` does not exist: `rooms` has levels 0 to 7";
        assert_eq!(check("default:5..8", 8), Err(words.to_owned()));
        let words = "level 1 of `default` does not exist: `rooms` has only one, level 0";
        assert_eq!(check("default:1", 1), Err(words.to_owned()));
    }

    #[test]
    fn a_level_belongs_to_a_split_of_its_mode() {
        let split: LevelSplit = "hard:64..127".parse().expect("a split");
        assert!(split.contains("hard", 64) && split.contains("hard", 127));
        assert!(!split.contains("hard", 63) && !split.contains("hard", 128) && !split.contains("easy", 64));
    }

    #[test]
    fn overlap_needs_the_same_mode() {
        let split = |text: &str| text.parse::<LevelSplit>().expect("a split");
        assert!(split("hard:0..63").overlaps(&split("hard:63..80")));
        assert!(!split("hard:0..63").overlaps(&split("hard:64..127")));
        assert!(!split("hard:0..63").overlaps(&split("easy:0..63")));
    }
}

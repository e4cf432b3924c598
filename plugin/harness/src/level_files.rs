//! Levels from files, as drawn by a designer.
//!
//! Their mode is the text `files:` followed by a pattern, such as `files:levels/**/*.json`. Their numbers count the
//! files in the order of their paths. A game reads a file with [`Game::parse_level`](crate::game::Game::parse_level).
//! Its Worlds hold all files as [`LevelDesigns`], where the game looks before it makes a level itself.
//!
//! The files of the folder, in reading order:
//!
//! - [`read`]: level files, read once for all Worlds of a verb.
//! - `error`: errors of level files, of patterns and of the text of a level.

mod error;
pub mod read;

use crate::level_files::read::{DrawnLevels, Parse};
use bevy::prelude::*;
use bevy_playbot::{engine::LevelFiles, level::LevelFile, state_hash::StateHash};
use std::{any::Any, path::Path, sync::Arc};

pub use crate::level_files::error::{JsonStep, LevelFileError, LevelTextError, Utf16, read_json, read_json_object};

/// Largest number of files: a range cannot have more levels.
const MOST: usize = 1 << 24;

/// Prefix of the mode of levels from files.
pub const LEVEL_FILES: &str = "files:";

/// Levels from files, by number.
///
/// Worlds whose mode names files hold them as a resource before the game is built. When an episode starts, a game
/// looks here first, and makes a level itself if the resource is missing.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug)]
pub struct LevelDesigns(DrawnLevels);

impl LevelDesigns {
    /// Reads the files of a mode from the disk. [`of`](Self::of) returns these from now on.
    ///
    /// # Errors
    ///
    /// The mode names no files, a file cannot be read, or a file is not a level of this game.
    pub fn read(
        game: &str,
        mode: &str,
        parse: &dyn Fn(&str) -> Result<LevelDesign, LevelTextError>,
    ) -> Result<Self, LevelFileError> {
        Self::read_with(game, mode, Parse::Text(parse))
    }

    /// Returns the files of a mode as last read, and reads them first if needed.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read).
    pub fn of(
        game: &str,
        mode: &str,
        parse: &dyn Fn(&str) -> Result<LevelDesign, LevelTextError>,
    ) -> Result<Self, LevelFileError> {
        Self::of_with(game, mode, Parse::Text(parse))
    }

    /// Reads the files of a mode as [`read`](Self::read) does, with a parser of texts or of bytes.
    pub(crate) fn read_with(game: &str, mode: &str, parse: Parse) -> Result<Self, LevelFileError> {
        read::read_now(game, level_file_pattern(mode).unwrap_or(mode), parse).map(Self)
    }

    /// Returns the files of a mode as [`of`](Self::of) does, with a parser of texts or of bytes.
    pub(crate) fn of_with(game: &str, mode: &str, parse: Parse) -> Result<Self, LevelFileError> {
        read::as_read(game, level_file_pattern(mode).unwrap_or(mode), parse).map(Self)
    }

    /// Reads the level of one file, as level 0.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is not a level of this game.
    pub fn of_file(
        path: &str,
        parse: &dyn Fn(&str) -> Result<LevelDesign, LevelTextError>,
    ) -> Result<Self, LevelFileError> {
        Self::of_file_with(path, Parse::Text(parse))
    }

    /// Reads the level of one file as [`of_file`](Self::of_file) does, with a parser of texts or of bytes.
    pub(crate) fn of_file_with(path: &str, parse: Parse) -> Result<Self, LevelFileError> {
        Ok(Self(Arc::new(vec![read::read_one(path, parse)?])))
    }

    /// Wraps a single level as level 0, under a name instead of a path.
    pub fn one(name: impl Into<String>, design: LevelDesign) -> Self {
        Self(Arc::new(vec![DrawnLevel { path: name.into(), design }]))
    }

    /// Returns the number of levels, at least 1.
    pub fn count(&self) -> u64 {
        self.0.len() as u64
    }

    fn drawn(&self, level: u64) -> Option<&DrawnLevel> {
        self.0.get(usize::try_from(level).ok()?)
    }

    /// Returns a level in the game's own type.
    ///
    /// # Errors
    ///
    /// A message if there is no such level, or it is of another type.
    pub fn get<T: Any + Send + Sync>(&self, level: u64) -> Result<Arc<T>, String> {
        let design = self.design(level)?;
        design.level().ok_or_else(|| format!("{} was read by another game", self.path(level).unwrap_or_default()))
    }

    /// Returns a level with its hash.
    ///
    /// # Errors
    ///
    /// A message if there is no such level.
    pub fn design(&self, level: u64) -> Result<&LevelDesign, String> {
        self.drawn(level).map(|drawn| &drawn.design).ok_or_else(|| {
            let count = self.count();
            format!("level {level} does not exist: the number of level files is {count}, counted from 0")
        })
    }

    /// Returns the path of a level's file.
    pub fn path(&self, level: u64) -> Option<&str> {
        self.drawn(level).map(|drawn| drawn.path.as_str())
    }

    /// Returns the hash of a level's content.
    pub fn hash(&self, level: u64) -> Option<u64> {
        self.drawn(level).map(|drawn| drawn.design.hash())
    }

    /// Returns the hash of a level's layout.
    pub fn layout(&self, level: u64) -> Option<u64> {
        self.drawn(level).map(|drawn| drawn.design.layout())
    }

    /// Returns the description of the levels that recordings keep.
    pub fn files(&self) -> LevelFiles {
        let file = |drawn: &DrawnLevel| LevelFile { path: drawn.path.clone(), hash: drawn.design.hash() };
        LevelFiles::new(self.0.iter().map(file).collect())
    }
}

/// A level as read by its game.
#[derive(Clone, Debug)]
pub struct LevelDesign {
    level: Arc<dyn Any + Send + Sync>,
    hash: u64,
    layout: Option<u64>,
}

impl LevelDesign {
    /// Wraps a level of the game's own type.
    ///
    /// `content` is all of the level that affects play, in one canonical form. So the level has the same hash under
    /// any layout of its file.
    pub fn new<T: Any + Send + Sync>(level: T, content: &str) -> Self {
        Self::of_bytes(level, content.as_bytes())
    }

    /// Wraps a level of the game's own type as [`new`](Self::new) does, where its content is not a text.
    pub fn of_bytes<T: Any + Send + Sync>(level: T, content: &[u8]) -> Self {
        let hash = StateHash::of(content.iter().copied().map(u64::from)).0;
        Self { level: Arc::new(level), hash, layout: None }
    }

    /// Adds the hash of the level's [layout](crate::game::LevelTools::layout_hash), by which it is found among the levels
    /// that the game draws itself.
    pub fn with_layout(self, layout: u64) -> Self {
        Self { layout: Some(layout), ..self }
    }

    /// Returns the hash of the layout; without one, the hash of the content.
    pub fn layout(&self) -> u64 {
        self.layout.unwrap_or(self.hash)
    }

    /// Returns a hash of the content.
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// Returns the level; `None` if it is of another type.
    pub fn level<T: Any + Send + Sync>(&self) -> Option<Arc<T>> {
        self.level.clone().downcast().ok()
    }
}

/// A level with the path of its file.
#[derive(Clone, Debug)]
struct DrawnLevel {
    path: String,
    design: LevelDesign,
}

/// Returns the files that match a pattern, sorted by path: `*` stands for any name, `**` for any folders, `[ab]` for a
/// letter. A file with the pattern as its name is taken alone. Paths are relative to the current folder of the program.
///
/// # Errors
///
/// The pattern is invalid, or no file matches.
pub fn find_level_files(pattern: &str) -> Result<Vec<String>, LevelFileError> {
    let literal = Path::new(pattern);
    if pattern.contains(['*', '?', '[']) && literal.is_file() {
        return Ok(vec![shown(literal)]);
    }
    let found = glob::glob(pattern).map_err(|error| LevelFileError::Pattern {
        pattern: pattern.to_owned(),
        at: error.pos + 1,
        why: error.msg.to_owned(),
    })?;
    let mut paths = Vec::new();
    let mut folder = None;
    for entry in found {
        let path = entry.map_err(|error| LevelFileError::Unreadable {
            path: shown(error.path()),
            why: error.error().to_string(),
        })?;
        if path.is_dir() {
            folder.get_or_insert_with(|| shown(&path));
        } else {
            paths.push(shown(&path));
        }
        if paths.len() > MOST {
            return Err(LevelFileError::TooMany { pattern: pattern.to_owned() });
        }
    }
    if !paths.is_empty() {
        // The order of file systems differs.
        paths.sort_unstable();
        return Ok(paths);
    }
    Err(match folder {
        Some(path) => LevelFileError::Folder { path },
        None => {
            let folder = std::env::current_dir().map_or_else(|_| "here".to_owned(), |folder| shown(&folder));
            LevelFileError::NoFiles { pattern: pattern.to_owned(), folder }
        }
    })
}

/// Formats a path, equal on all systems.
fn shown(path: &Path) -> String {
    let text = path.to_string_lossy();
    if cfg!(windows) { text.replace('\\', "/") } else { text.into_owned() }
}

// Mode of levels from files, as text.

/// Returns whether the levels of a mode are files.
pub fn is_level_files(mode: &str) -> bool {
    level_file_pattern(mode).is_some()
}

/// Returns the file pattern of a mode, if its levels are files.
pub fn level_file_pattern(mode: &str) -> Option<&str> {
    mode.strip_prefix(LEVEL_FILES)
}

/// Returns the mode whose only level is this file, for any characters in the path.
pub fn level_files_mode(path: &str) -> String {
    format!("{LEVEL_FILES}{}", glob::Pattern::escape(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{fs, path::Path};

    /// Parses a level that is a single number.
    fn number(text: &str) -> Result<LevelDesign, LevelTextError> {
        let number: u32 =
            text.trim().parse().map_err(|_| LevelTextError { line: Some(1), what: "no number".into() })?;
        Ok(LevelDesign::new(number, &number.to_string()))
    }

    fn mode(folder: &Path) -> String {
        format!("{}/*", level_files_mode(&folder.to_string_lossy()))
    }

    #[test]
    fn levels_are_read_when_the_mode_is_checked_and_stay_the_same_until_then() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("writable");
        write("b", "2");
        write("a", " 1\n");
        let mode = mode(folder.path());
        let numbers = |designs: &LevelDesigns| -> Vec<u32> {
            (0..designs.count()).map(|level| *designs.get(level).expect("a number")).collect()
        };
        assert_eq!(numbers(&LevelDesigns::of("numbers", &mode, &number).expect("read")), [1, 2]);
        write("b", "7");
        assert_eq!(numbers(&LevelDesigns::of("numbers", &mode, &number).expect("known")), [1, 2]);
        let again = LevelDesigns::read("numbers", &mode, &number).expect("read");
        assert_eq!(numbers(&again), [1, 7]);
        assert_eq!(numbers(&LevelDesigns::of("others", &mode, &number).expect("known")), [1, 7]);
        assert!(again.path(1).expect("a path").ends_with("/b") && again.path(2).is_none());
        assert_eq!(again.hash(0), Some(LevelDesign::new((), "1").hash()), "blanks are not played");
        assert_eq!(again.files().of(1).map(|file| file.hash), again.hash(1));
    }

    #[test]
    fn what_cannot_be_had_is_said() {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("a"), "1").expect("writable");
        fs::write(folder.path().join("b"), "one").expect("writable");
        let error = LevelDesigns::read("numbers", &mode(folder.path()), &number).expect_err("no number").to_string();
        assert!(error.ends_with("/b, line 1: no number"), "{error}");
        fs::write(folder.path().join("e"), "two").expect("writable");
        let error = LevelDesigns::read("numbers", &mode(folder.path()), &number).expect_err("no numbers").to_string();
        assert!(error.contains("/b, line 1: no number; and 1 more: ") && error.ends_with("/e"), "{error}");
        let path = folder.path().join("a").to_string_lossy().into_owned();
        let designs = LevelDesigns::of_file(&path, &number).expect("a number");
        assert!(
            designs
                .get::<u32>(1)
                .expect_err("one file")
                .contains("level 1 does not exist: the number of level files is 1")
        );
        assert!(designs.get::<String>(0).expect_err("a number").contains("another game"));
        fs::write(folder.path().join("c"), b"1\n 2\xff").expect("writable");
        let path = folder.path().join("c").to_string_lossy().into_owned();
        let error = LevelDesigns::of_file(&path, &number).expect_err("no text").to_string();
        assert!(error.contains("/c, line 2: byte 3 of the line is not UTF-8"), "{error}");
        let path = folder.path().join("d").to_string_lossy().into_owned();
        fs::File::create(&path).and_then(|file| file.set_len((32 << 20) + 1)).expect("writable");
        let error = LevelDesigns::of_file(&path, &number).expect_err("too large").to_string();
        assert!(error.contains("/d has 33554433 bytes, and a level file has at most 33554432"), "{error}");
        let missing = LevelDesigns::of_file("no/such/file", &number).expect_err("missing");
        assert!(matches!(missing, LevelFileError::Unreadable { .. }));
    }

    #[test]
    fn a_level_is_given_out_as_what_it_is_and_hashed_by_its_content() {
        let design = LevelDesign::new(7u8, "seven");
        assert_eq!((design.level::<u8>().as_deref(), design.level::<u16>()), (Some(&7), None));
        assert_eq!(design.hash(), LevelDesign::new((), "seven").hash());
        assert_ne!(design.hash(), LevelDesign::new(7u8, "sevem").hash());
    }

    #[test]
    fn files_are_found_in_the_order_of_their_paths_and_folders_are_none() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = glob::Pattern::escape(&shown(folder.path()));
        for file in ["b.json", "a/z.json", "a/c/y.json", "a.txt"] {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().expect("below the root")).expect("writable");
            std::fs::write(path, "{}").expect("writable");
        }
        std::fs::create_dir(folder.path().join("folder.json")).expect("writable");
        let names = |pattern: &str| -> Vec<String> {
            let found = find_level_files(&format!("{root}/{pattern}")).expect("files");
            let start = shown(folder.path()).len() + 1;
            found.iter().map(|path| path[start..].to_owned()).collect()
        };
        assert_eq!(names("**/*.json"), ["a/c/y.json", "a/z.json", "b.json"]);
        assert_eq!(names("*.json"), ["b.json"]);
        assert_eq!(names("a/z.json"), ["a/z.json"]);
        let error = |pattern: &str| find_level_files(&format!("{root}/{pattern}")).expect_err("no files");
        assert!(matches!(error("*.ron"), LevelFileError::NoFiles { .. }));
        let words = error("a").to_string();
        assert!(words.contains("is a folder") && words.contains("/a/**/*.json"), "{words}");
        assert!(matches!(find_level_files("a/***/b"), Err(LevelFileError::Pattern { .. })));
    }

    #[test]
    fn a_file_whose_name_is_the_pattern_is_taken_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        for file in ["a[1].json", "a1.json"] {
            std::fs::write(folder.path().join(file), "{}").expect("writable");
        }
        let found = |name: &str| find_level_files(&shown(&folder.path().join(name)));
        let paths = |names: &[&str]| Ok(names.iter().map(|name| shown(&folder.path().join(name))).collect::<Vec<_>>());
        assert_eq!(found("a[1].json"), paths(&["a[1].json"]));
        assert_eq!(found("a[12].json"), paths(&["a1.json"]));
    }

    #[test]
    fn a_mode_of_files_has_a_pattern_and_others_have_none() {
        assert_eq!(level_file_pattern("files:levels/*.json"), Some("levels/*.json"));
        assert!(!is_level_files("hard") && is_level_files("files:"));
        assert_eq!(level_files_mode("a[1].json"), "files:a[[]1[]].json");
    }
}

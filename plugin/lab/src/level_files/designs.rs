//! The levels of a World that come from files.

use std::{any::Any, sync::Arc};

use bevy::prelude::*;
use bevy_playbot::level_files::{LevelFile, LevelFiles};

use super::{
    design::{DrawnLevel, LevelDesign},
    error::LevelFileError,
    mode::level_file_pattern,
    read::{self, DrawnLevels},
    text_error::LevelTextError,
};

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
        read::read_now(game, level_file_pattern(mode).unwrap_or(mode), parse).map(Self)
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
        let Some(DrawnLevel { path, design }) = self.drawn(level) else {
            let count = self.count();
            return Err(format!("level {level} does not exist: the number of level files is {count}, counted from 0"));
        };
        design.level().ok_or_else(|| format!("{path} was read by another game"))
    }

    /// Returns the path of a level's file.
    pub fn path(&self, level: u64) -> Option<&str> {
        self.drawn(level).map(|drawn| drawn.path.as_str())
    }

    /// Returns the hash of a level's content.
    pub fn hash(&self, level: u64) -> Option<u64> {
        self.drawn(level).map(|drawn| drawn.design.hash())
    }

    /// Returns the description of the levels that recordings keep.
    pub fn files(&self) -> LevelFiles {
        let file = |drawn: &DrawnLevel| LevelFile { path: drawn.path.clone(), hash: drawn.design.hash() };
        LevelFiles::new(self.0.iter().map(file).collect())
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use super::*;
    use crate::level_files::level_files_mode;

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
}

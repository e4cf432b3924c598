//! Level files: the files that stand for the level numbers of a World.
//!
//! A level number identifies a level only until a file is added, renamed or edited. Recordings
//! therefore keep the path of the file and a hash of the level in it. A replay checks here that it
//! gets the same level.

use std::fmt;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// The file of a level: its path, and a hash of the level in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Reflect)]
pub struct LevelFile {
    /// Path of the file, as it was found.
    pub path: String,
    /// Hash of the level, independent of the file's layout.
    pub hash: u64,
}

impl fmt::Display for LevelFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (hash {:016x})", self.path, self.hash)
    }
}

/// The files of a World's levels: level i is file i. Missing where levels are not files.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct LevelFiles(Vec<LevelFile>);

impl LevelFiles {
    /// Files in the order of their level numbers.
    pub fn new(files: Vec<LevelFile>) -> Self {
        Self(files)
    }

    /// Returns the file of a level.
    pub fn of(&self, level: u64) -> Option<&LevelFile> {
        self.0.get(usize::try_from(level).ok()?)
    }

    /// Returns the current level number of a recorded file. The same file is preferred, then the
    /// same level in another file, then another level in a file of that name.
    pub fn number_of(&self, recorded: &LevelFile) -> Option<u64> {
        let find = |is_it: &dyn Fn(&LevelFile) -> bool| self.0.iter().position(is_it);
        let index = find(&|file| file == recorded)
            .or_else(|| find(&|file| file.hash == recorded.hash))
            .or_else(|| find(&|file| file.path == recorded.path))?;
        u64::try_from(index).ok()
    }

    /// Returns why this level is not the recorded one, with advice for the recording's owner;
    /// `None` if it is.
    pub fn difference(&self, level: u64, recorded: &LevelFile) -> Option<String> {
        match self.of(level) {
            Some(file) if file.hash == recorded.hash => None,
            Some(file) if file.path == recorded.path => Some(format!(
                "the level file {} has the hash {:016x}, but {:016x} in the recording: it has changed; restore the \
                 recorded file",
                file.path, file.hash, recorded.hash
            )),
            Some(file) => Some(format!(
                "the recorded level file {recorded} is missing; the level is {file} now: restore the recorded file"
            )),
            None => Some(format!("the recorded level file {recorded} is missing: restore it")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(path: &str, hash: u64) -> LevelFile {
        LevelFile { path: path.to_owned(), hash }
    }

    #[test]
    fn a_recorded_file_is_found_by_name_and_hash_then_by_hash_then_by_name() {
        let files = LevelFiles::new(vec![file("a", 1), file("b", 2), file("c", 2)]);
        assert_eq!(files.number_of(&file("c", 2)), Some(2), "the same file");
        assert_eq!(files.number_of(&file("moved", 2)), Some(1), "the same level under another name");
        assert_eq!(files.number_of(&file("a", 9)), Some(0), "another level under the same name");
        assert_eq!(files.number_of(&file("gone", 9)), None);
    }

    #[test]
    fn another_level_of_the_same_name_is_told_with_both_hashes() {
        let files = LevelFiles::new(vec![file("a.json", 0x1f)]);
        assert_eq!(files.difference(0, &file("a.json", 0x1f)), None);
        assert_eq!(files.difference(0, &file("renamed.json", 0x1f)), None);
        let words = files.difference(0, &file("a.json", 0x2e)).expect("another level");
        assert!(words.contains("the hash 000000000000001f, but 000000000000002e in the recording"), "{words}");
        assert!(words.ends_with("restore the recorded file"), "what is no recording is not recorded again: {words}");
        let words = files.difference(0, &file("b.json", 0x2e)).expect("another file");
        assert!(words.contains("b.json (hash 000000000000002e)") && words.contains("a.json"), "{words}");
        assert!(files.difference(1, &file("b.json", 0x2e)).expect("no level").contains("not there any more"));
    }
}

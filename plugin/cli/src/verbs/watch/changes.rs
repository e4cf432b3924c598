//! Files that are saved.
//!
//! Files are looked at again and again, instead of asking the system to tell: that works on every disk and every system, and
//! goes on when a folder is deleted and made anew.

use crate::{error::CliError, verbs::watch::GLANCE};
use playbot_harness::{
    level_files::{LevelFileError, find_level_files, level_file_pattern},
    split::LevelSplit,
};
use std::{
    collections::BTreeMap,
    fs,
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::{Instant, SystemTime},
};

/// Size and time of a file, which another save changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stamp {
    bytes: u64,
    modified: Option<SystemTime>,
}

impl Stamp {
    /// Returns the stamp of a file; `None` if there is none.
    pub fn of(path: impl AsRef<std::path::Path>) -> Option<Self> {
        let found = fs::metadata(path).ok()?;
        Some(Self { bytes: found.len(), modified: found.modified().ok() })
    }
}

/// The level files of a pattern.
pub(super) struct LevelFiles {
    pattern: String,
}

impl LevelFiles {
    /// Names the files of a range. There may be none yet.
    ///
    /// # Errors
    ///
    /// The pattern is not valid, or names folders alone.
    pub fn new(split: &LevelSplit) -> Result<Self, CliError> {
        let pattern = level_file_pattern(&split.mode).unwrap_or(&split.mode).to_owned();
        match find_level_files(&pattern) {
            Ok(_) | Err(LevelFileError::NoFiles { .. }) => Ok(Self { pattern }),
            Err(error) => Err(CliError::Usage(error.to_string())),
        }
    }

    /// Returns all files with their stamps, and what keeps them from being found.
    pub fn look(&self) -> (BTreeMap<String, Stamp>, Option<LevelFileError>) {
        match find_level_files(&self.pattern) {
            Ok(paths) => {
                let stamped = paths.into_iter().filter_map(|path| Stamp::of(&path).map(|stamp| (path, stamp)));
                (stamped.collect(), None)
            }
            Err(error) => (BTreeMap::new(), Some(error)),
        }
    }
}

/// A level file that may be saved again while it is tested.
pub(super) struct Edited {
    path: String,
    stamp: Option<Stamp>,
    next: Mutex<Instant>,
    is_again: AtomicBool,
}

impl Edited {
    /// Watches a file with this stamp.
    pub fn new(path: &str, stamp: Option<Stamp>) -> Self {
        Self {
            path: path.to_owned(),
            stamp,
            next: Mutex::new(Instant::now() + GLANCE),
            is_again: AtomicBool::new(false),
        }
    }

    /// Returns true once it was saved again, or is gone. It is cheap, since the disk is seldom asked.
    pub fn is_again(&self) -> bool {
        if !self.is_again.load(Ordering::Relaxed)
            && let Ok(mut next) = self.next.try_lock()
            && Instant::now() >= *next
        {
            *next = Instant::now() + GLANCE;
            if Stamp::of(&self.path) != self.stamp {
                self.is_again.store(true, Ordering::Relaxed);
            }
        }
        self.is_again.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{thread, time::Duration};

    #[test]
    #[expect(clippy::disallowed_methods, reason = "a file is saved a little later")]
    fn a_file_that_is_saved_again_is_noticed() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a.json");
        fs::write(&file, "one").expect("writable");
        let edited = Edited::new(file.to_str().expect("a name"), Stamp::of(&file));
        thread::sleep(2 * GLANCE);
        assert!(!edited.is_again());
        fs::write(&file, "another").expect("writable");
        thread::sleep(GLANCE + Duration::from_millis(10));
        assert!(edited.is_again());
        fs::remove_file(&file).expect("it is there");
        assert!(edited.is_again(), "it does not forget");
    }

    #[test]
    fn a_folder_that_is_gone_is_reported_and_may_come_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let levels = folder.path().join("levels");
        fs::create_dir(&levels).expect("writable");
        fs::write(levels.join("a.json"), "{}").expect("writable");
        let mode = |pattern: &str| LevelSplit::one(format!("files:{}/{pattern}", folder.path().display()), 0);
        let files = LevelFiles::new(&mode("levels/*.json")).expect("one file");
        assert!(LevelFiles::new(&mode("later/*.json")).is_ok_and(|files| files.look().1.is_some()), "it may come");
        let refused = LevelFiles::new(&mode("levels")).err().map(|error| error.to_string());
        assert!(refused.is_some_and(|words| words.contains("is a folder: name the files in it")));
        assert_eq!(files.look().0.len(), 1);
        fs::remove_dir_all(&levels).expect("it is there");
        let (found, problem) = files.look();
        assert!(found.is_empty() && problem.is_some_and(|problem| problem.to_string().contains("matches no file")));
        fs::create_dir(&levels).expect("writable");
        fs::write(levels.join("b.json"), "{}").expect("writable");
        assert!(files.look().0.keys().all(|path| path.ends_with("b.json")));
    }
}

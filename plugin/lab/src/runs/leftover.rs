//! Leftovers of replaced runs.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use crate::{
    shell_word::shell_word,
    train::run_lock::{RunLock, run_of_leftover},
};

/// Parts of a run that a process moved aside to replace it, and did not remove, for instance because it was killed.
/// Its text form names the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Leftover {
    /// Folder of the parts.
    pub folder: PathBuf,
    /// Folder of the replaced run.
    pub run: PathBuf,
}

impl Leftover {
    /// Recognises a leftover by its folder's name; `None` for any other folder.
    pub(super) fn of(folder: &Path) -> Option<Self> {
        Some(Self { folder: folder.into(), run: run_of_leftover(folder)? })
    }
}

impl fmt::Display for Leftover {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (folder, run) = (self.folder.display(), self.run.display());
        write!(f, "{folder} holds old files of {run}, ")?;
        if RunLock::is_taken(&self.run) {
            return write!(f, "which a process is replacing: look again when it has ended");
        }
        if !self.run.is_dir() {
            return write!(f, "which is gone: rename {folder} to that name to get the run back, or delete it");
        }
        let run = shell_word(&run.to_string());
        write!(
            f,
            "whose replacement was stopped: `playbot train --run {run} --resume` brings the old run back, or removes it \
             if the new one has begun"
        )
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn what_to_do_depends_on_what_is_in_the_place_of_the_run() {
        let parent = tempfile::tempdir().expect("a folder");
        let (folder, run) = (parent.path().join("a.replaced-12"), parent.path().join("a"));
        let left = Leftover::of(&folder).expect("its name says so");
        assert_eq!(left, Leftover { folder, run: run.clone() });
        assert_eq!(Leftover::of(&run), None);
        assert!(left.to_string().contains("is gone: rename"), "{left}");
        fs::create_dir(&run).expect("writable");
        let words = left.to_string();
        assert!(
            words.contains("a.replaced-12 holds old files of ") && words.contains("--resume` brings the old"),
            "{words}"
        );
        let _lock = RunLock::take(&run).expect("free");
        assert!(left.to_string().contains("look again when it has ended"), "{left}");
    }
}

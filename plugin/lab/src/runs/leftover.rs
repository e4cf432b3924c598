//! What is left beside runs that were to be replaced.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use crate::{
    shell_word::shell_word,
    train::{replaced_run::run_of_leftover, run_lock::RunLock},
};

/// Parts of a run that a process moved aside to put another one into its place, and could not remove any more, say because
/// it was killed. As text it says what to do about them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Leftover {
    /// The folder that they lie in.
    pub folder: PathBuf,
    /// The run that they were.
    pub run: PathBuf,
}

impl Leftover {
    /// What a folder is left of, which its name says; `None` for any other folder.
    pub(super) fn of(folder: &Path) -> Option<Self> {
        Some(Self { folder: folder.into(), run: run_of_leftover(folder)? })
    }
}

impl fmt::Display for Leftover {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (folder, run) = (self.folder.display(), self.run.display());
        write!(f, "{folder} holds what {run} was before it was to be replaced, ")?;
        if RunLock::is_taken(&self.run) {
            return write!(f, "and a process works in {run}: look again when it has ended");
        }
        if !self.run.is_dir() {
            return write!(f, "and {run} is gone: give {folder} that name to have the run back, or delete it");
        }
        let run = shell_word(&run.to_string());
        write!(
            f,
            "which was stopped: `playbot train --run {run} --resume` brings the old run back, or removes it if the new \
             one has begun"
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
        assert!(left.to_string().contains("is gone: give"), "{left}");
        fs::create_dir(&run).expect("writable");
        let words = left.to_string();
        assert!(words.contains("a.replaced-12 holds what ") && words.contains("--resume` brings the old"), "{words}");
        let _lock = RunLock::take(&run).expect("free");
        assert!(left.to_string().contains("look again when it has ended"), "{left}");
    }
}

//! Search for the folders of runs.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use super::{error::RunsError, leftover::Leftover};

/// Files and folders that only a run has. One is enough to find a run, even if the others are lost.
const SIGNS: [&str; 3] = ["run.json", "metrics.jsonl", "checkpoints"];

/// Runs and leftovers at a path or below it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FoundRuns {
    /// The folders of runs, sorted by path, whole or damaged.
    pub runs: Vec<PathBuf>,
    /// Leftovers of replaced runs, sorted by path. They are not runs: the next training in the folder removes them.
    pub leftovers: Vec<Leftover>,
}

impl FoundRuns {
    /// Searches `root` and, if it is not a run, all folders below it. Runs are not searched for further runs, and
    /// links to folders are not followed.
    ///
    /// # Errors
    ///
    /// [`RunsError::Missing`]; [`RunsError::NoRuns`] if neither runs nor leftovers are found; [`RunsError::Io`] for a
    /// folder that cannot be listed.
    pub fn at(root: &Path) -> Result<Self, RunsError> {
        if !root.is_dir() {
            return Err(RunsError::Missing(root.into()));
        }
        let (mut found, mut folders) = (Self::default(), vec![root.to_owned()]);
        while let Some(folder) = folders.pop() {
            if SIGNS.iter().any(|sign| folder.join(sign).exists()) {
                found.runs.push(folder);
                continue;
            }
            for below in folders_in(&folder).map_err(|source| RunsError::Io { path: folder, source })? {
                match Leftover::of(&below) {
                    Some(leftover) => found.leftovers.push(leftover),
                    None => folders.push(below),
                }
            }
        }
        if found == Self::default() {
            return Err(RunsError::NoRuns(root.into()));
        }
        found.runs.sort();
        found.leftovers.sort_by(|one, other| one.folder.cmp(&other.folder));
        Ok(found)
    }
}

/// Returns the folders of runs at `root`: itself, or all below it, see [`FoundRuns::at`].
///
/// # Errors
///
/// As for [`FoundRuns::at`], and [`RunsError::NoRuns`] if only leftovers are found.
pub fn find_runs(root: &Path) -> Result<Vec<PathBuf>, RunsError> {
    let runs = FoundRuns::at(root)?.runs;
    if runs.is_empty() { Err(RunsError::NoRuns(root.into())) } else { Ok(runs) }
}

fn folders_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut folders = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            folders.push(entry.path());
        }
    }
    Ok(folders)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_found_whole_or_damaged() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path();
        for path in ["b/seed-2", "b/seed-1/tensorboard", "lost/checkpoints", "a", "empty/deep"] {
            fs::create_dir_all(root.join(path)).expect("created");
        }
        for file in ["b/seed-2/run.json", "b/seed-1/metrics.jsonl", "a/run.json", "empty/notes.txt"] {
            fs::write(root.join(file), "").expect("written");
        }
        let found = find_runs(root).expect("found");
        assert_eq!(found, ["a", "b/seed-1", "b/seed-2", "lost"].map(|name| root.join(name)));
        assert_eq!(find_runs(&root.join("a")).expect("itself"), [root.join("a")]);
        assert!(matches!(find_runs(&root.join("empty")), Err(RunsError::NoRuns(_))));
        assert!(matches!(find_runs(&root.join("missing")), Err(RunsError::Missing(_))));
    }

    #[test]
    fn what_is_left_of_a_run_is_named_and_is_no_run() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path();
        for path in ["b/seed-1", "b/seed-1.replaced-7", "a.replaced-31", "c.replaced-it"] {
            fs::create_dir_all(root.join(path)).expect("created");
            fs::write(root.join(path).join("run.json"), "").expect("written");
        }
        let found = FoundRuns::at(root).expect("found");
        assert_eq!(found.runs, ["b/seed-1", "c.replaced-it"].map(|name| root.join(name)));
        let folders: Vec<&Path> = found.leftovers.iter().map(|leftover| leftover.folder.as_path()).collect();
        assert_eq!(folders, [root.join("a.replaced-31"), root.join("b/seed-1.replaced-7")]);
        assert_eq!(find_runs(root).expect("found"), found.runs);
        // A leftover alone is reported too.
        fs::remove_dir_all(root.join("b")).expect("removed");
        fs::remove_dir_all(root.join("c.replaced-it")).expect("removed");
        assert!(FoundRuns::at(root).expect("found").runs.is_empty());
        assert!(matches!(find_runs(root), Err(RunsError::NoRuns(_))));
    }
}

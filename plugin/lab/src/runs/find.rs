//! Finding the folders of runs.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use super::error::RunsError;
use crate::train::replaced_run::is_leftover;

/// Files and folders that only a run has. One of them is enough, so that a run that lost the others is found as well.
const SIGNS: [&str; 3] = ["run.json", "metrics.jsonl", "checkpoints"];

/// The folders of runs at `root`: itself, or all below it, sorted by path, whole or damaged. Runs are not searched for
/// further runs, and links to folders are not followed.
///
/// # Errors
///
/// [`RunsError::Missing`], [`RunsError::NoRuns`], or [`RunsError::Io`] for a folder that cannot be listed.
pub fn find_runs(root: &Path) -> Result<Vec<PathBuf>, RunsError> {
    if !root.is_dir() {
        return Err(RunsError::Missing(root.into()));
    }
    let (mut found, mut folders) = (Vec::new(), vec![root.to_owned()]);
    while let Some(folder) = folders.pop() {
        if SIGNS.iter().any(|sign| folder.join(sign).exists()) {
            found.push(folder);
            continue;
        }
        folders.extend(folders_in(&folder).map_err(|source| RunsError::Io { path: folder, source })?);
    }
    if found.is_empty() {
        return Err(RunsError::NoRuns(root.into()));
    }
    found.sort();
    Ok(found)
}

fn folders_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut folders = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        // What a process that was killed left of a run is no run: the next training there ends it.
        if entry.file_type()?.is_dir() && !is_leftover(&entry.path()) {
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
}

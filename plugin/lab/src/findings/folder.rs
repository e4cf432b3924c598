//! Folders of findings.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use playbot_learner::disk;

use super::{
    error::{FindingError, io_error},
    file_name::ENDING,
};

/// Name of the folder with findings, in that of a test.
pub const FINDINGS: &str = "findings";

/// Returns the files of findings in a folder and in its `findings`, with their names without ending, sorted by name.
///
/// # Errors
///
/// [`FindingError::None`] if there are no findings, [`FindingError::NoFolder`] if the path is not a folder; or the
/// folder cannot be read.
pub fn list_findings(folder: &Path) -> Result<Vec<(String, PathBuf)>, FindingError> {
    let mut found = files_in(folder).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => FindingError::NoFolder(folder.into()),
        _ => io_error("list", folder)(source),
    })?;
    let below = folder.join(FINDINGS);
    if below.is_dir() {
        found.extend(files_in(&below).map_err(io_error("list", &below))?);
    }
    if found.is_empty() {
        return Err(FindingError::None(folder.into()));
    }
    // The file system's order is not reproducible.
    found.sort();
    Ok(found)
}

/// Removes the findings of an earlier test from its folder.
///
/// # Errors
///
/// The system cannot remove them.
pub fn clear_findings(folder: &Path) -> Result<(), FindingError> {
    let below = folder.join(FINDINGS);
    if !below.is_dir() {
        return Ok(());
    }
    for (_, file) in files_in(&below).map_err(io_error("list", &below))? {
        disk::remove_file(&file).map_err(io_error("remove", &file))?;
    }
    Ok(())
}

/// Copies the findings of several tests into the folder of another one.
///
/// # Errors
///
/// The system cannot copy them.
pub fn gather_findings(folders: &[PathBuf], out: &Path) -> Result<(), FindingError> {
    for folder in folders {
        let (below, target) = (folder.join(FINDINGS), out.join(FINDINGS));
        if !below.is_dir() {
            continue;
        }
        disk::create_dir_all(&target).map_err(io_error("create", &target))?;
        for (name, file) in files_in(&below).map_err(io_error("list", &below))? {
            let copy = target.join(format!("{name}.{ENDING}"));
            let bytes = fs::read(&file).map_err(io_error("read", &file))?;
            playbot_learner::write_atomically(&copy, &bytes).map_err(io_error("write", &copy))?;
        }
    }
    Ok(())
}

fn files_in(folder: &Path) -> io::Result<Vec<(String, PathBuf)>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == ENDING) && path.is_file() {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            found.push((name, path));
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use playbot_learner::HasExitCode as _;

    use super::*;

    #[test]
    fn findings_are_listed_gathered_and_removed() {
        let parent = tempfile::tempdir().expect("a folder");
        let (one, two, all) = (parent.path().join("one"), parent.path().join("two"), parent.path().join("all"));
        for (folder, name) in [(&one, "b.finding"), (&one, "notes.txt"), (&two, "a.finding")] {
            fs::create_dir_all(folder.join(FINDINGS)).expect("writable");
            fs::write(folder.join(FINDINGS).join(name), name).expect("writable");
        }
        gather_findings(&[one.clone(), two, parent.path().join("none")], &all).expect("writable");
        fs::write(all.join("c.finding"), "c").expect("writable");
        let names =
            |folder: &Path| list_findings(folder).map(|found| found.into_iter().map(|(name, _)| name).collect());
        let found: Vec<String> = names(&all).expect("three");
        assert_eq!(found, ["a", "b", "c"]);
        clear_findings(&one).expect("writable");
        let none: Result<Vec<String>, _> = names(&one);
        assert!(matches!(none, Err(FindingError::None(_))));
        assert!(one.join(FINDINGS).join("notes.txt").exists(), "what is no finding stays");
        for no_folder in [parent.path().join("none"), all.join("c.finding")] {
            let error = list_findings(&no_folder).expect_err("no folder");
            assert!(error.is_usage() && error.to_string().contains("is not a folder: name one"), "{error}");
        }
        assert!(list_findings(&one).expect_err("none").to_string().contains("nothing to play again"));
    }
}

//! Search for recordings.

use std::fs;
use std::path::{Path, PathBuf};

use super::error::{DemoFault, DemoFileError};

/// Returns the recordings at `path`: the file itself, or all `*.demo` files in a folder and its subfolders,
/// sorted by path. Links to folders are not followed.
///
/// # Errors
///
/// [`DemoFault::NoDemos`] for a folder without any, [`DemoFault::Io`] when `path` does not exist or
/// cannot be listed.
pub fn find_demos(path: impl AsRef<Path>) -> Result<Vec<PathBuf>, DemoFileError> {
    let path = path.as_ref();
    let metadata = fs::metadata(path)
        .map_err(|source| DemoFileError::new(path, DemoFault::Io { action: "find recordings", source }))?;
    if !metadata.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut found = Vec::new();
    let mut folders = vec![path.to_owned()];
    while let Some(folder) = folders.pop() {
        list(&folder, &mut folders, &mut found)
            .map_err(|source| DemoFileError::new(&folder, DemoFault::Io { action: "list the folder", source }))?;
    }
    if found.is_empty() {
        return Err(DemoFileError::new(path, DemoFault::NoDemos));
    }
    found.sort();
    Ok(found)
}

fn list(folder: &Path, folders: &mut Vec<PathBuf>, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let path = entry.path();
        if entry.file_type()?.is_dir() {
            folders.push(path);
        } else if path.extension().is_some_and(|e| e == "demo") && path.is_file() {
            found.push(path);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_searched_in_order() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let root = folder.path();
        fs::create_dir_all(root.join("b/deep")).expect("created");
        fs::create_dir_all(root.join("folder.demo")).expect("created");
        for name in ["z.demo", "b/deep/1.demo", "a.demo", "a.demo.bak", "notes.txt"] {
            fs::write(root.join(name), "").expect("written");
        }
        let found = find_demos(root).expect("found");
        assert_eq!(found, ["a.demo", "b/deep/1.demo", "z.demo"].map(|n| root.join(n)));
        assert_eq!(find_demos(root.join("z.demo")).expect("a file"), [root.join("z.demo")]);
    }

    #[test]
    fn nothing_is_an_error() {
        let folder = tempfile::tempdir().expect("temporary folder");
        assert!(matches!(find_demos(folder.path()).expect_err("empty").fault, DemoFault::NoDemos));
        let missing = find_demos(folder.path().join("missing")).expect_err("missing");
        assert!(matches!(missing.fault, DemoFault::Io { .. }), "{missing}");
    }
}

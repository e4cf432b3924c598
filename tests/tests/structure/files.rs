//! Source files of the workspace.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// All files below a folder whose name ends so, in the order of their paths. Links and hidden folders are passed over,
/// and so are `target` and `runs`, which git ignores too.
pub fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    for entry in entries.map(|entry| entry.expect("readable")) {
        let (kind, name) = (entry.file_type().expect("known"), entry.file_name().to_string_lossy().into_owned());
        if kind.is_dir() && !name.starts_with('.') && !matches!(name.as_str(), "target" | "runs") {
            found.extend(files(&entry.path(), ending));
        } else if kind.is_file() && name.ends_with(ending) {
            found.push(entry.path());
        }
    }
    found.sort();
    found
}

/// A path as it is written within the workspace.
pub fn shown(workspace: &Path, file: &Path) -> String {
    file.strip_prefix(workspace).unwrap_or(file).display().to_string()
}

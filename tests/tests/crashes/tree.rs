//! Contents of a folder.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

/// Returns all files and folders below a folder, by their paths in it. Event files, whose names have the time of day,
/// are called `events`. Contents of a whole checkpoint are left out, since one more of them may be left.
pub fn tree(folder: &Path) -> BTreeSet<PathBuf> {
    let (mut found, mut folders) = (BTreeSet::new(), vec![folder.to_owned()]);
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(&next).expect("readable") {
            let path = entry.expect("readable").path();
            let name = path.file_name().expect("an entry").to_string_lossy().into_owned();
            if name.starts_with("step-") {
                continue;
            }
            let shown = if name.starts_with("events.out.") { path.with_file_name("events") } else { path.clone() };
            found.insert(shown.strip_prefix(folder).expect("below").to_owned());
            if path.is_dir() {
                folders.push(path);
            }
        }
    }
    found
}

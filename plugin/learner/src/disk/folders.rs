//! Operations on names and folders. The errors are those of the system.

use std::fs::{self, File};
use std::io;
use std::path::Path;

use super::DiskOperation;
use super::recording::{is_recorded, note};

/// Creates a folder and its missing parents.
///
/// # Errors
/// The system's error.
pub fn create_dir_all(path: &Path) -> io::Result<()> {
    let mut missing: Vec<&Path> = Vec::new();
    if is_recorded() {
        missing.extend(path.ancestors().take_while(|above| !above.as_os_str().is_empty() && !above.exists()));
    }
    fs::create_dir_all(path)?;
    missing.iter().rev().for_each(|folder| note(|| DiskOperation::CreateFolder((*folder).into())));
    Ok(())
}

/// Renames a file or folder; a file at the new name is replaced. The new name is flushed to the disk.
///
/// # Errors
/// The system's error.
pub fn rename(from: &Path, to: &Path) -> io::Result<()> {
    fs::rename(from, to)?;
    note(|| DiskOperation::Rename { from: from.into(), to: to.into() });
    // Only where folders can be opened; elsewhere the rename has to do.
    if let Some(Ok(folder)) = to.parent().map(File::open) {
        let _ = folder.sync_all();
    }
    Ok(())
}

/// Gives a file a second name.
///
/// # Errors
/// The system's error.
pub fn hard_link(from: &Path, to: &Path) -> io::Result<()> {
    fs::hard_link(from, to)?;
    note(|| DiskOperation::Link { from: from.into(), to: to.into() });
    Ok(())
}

/// Removes a file.
///
/// # Errors
/// The system's error.
pub fn remove_file(path: &Path) -> io::Result<()> {
    fs::remove_file(path)?;
    note(|| DiskOperation::Remove(path.into()));
    Ok(())
}

/// Removes an empty folder.
///
/// # Errors
/// The system's error.
pub fn remove_dir(path: &Path) -> io::Result<()> {
    fs::remove_dir(path)?;
    note(|| DiskOperation::Remove(path.into()));
    Ok(())
}

/// Removes a folder and all that is in it.
///
/// # Errors
/// The system's error.
pub fn remove_dir_all(path: &Path) -> io::Result<()> {
    if !is_recorded() || path.is_symlink() {
        return fs::remove_dir_all(path);
    }
    // In the order of the system's own function, so that each step is recorded.
    for entry in fs::read_dir(path)? {
        let entry = entry?;
        match entry.file_type()?.is_dir() {
            true => remove_dir_all(&entry.path())?,
            false => remove_file(&entry.path())?,
        }
    }
    remove_dir(path)
}

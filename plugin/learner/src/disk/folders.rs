//! Names and folders. The errors are those of the system.

use std::fs::{self, File};
use std::io;
use std::path::Path;

use super::DiskOperation;
use super::recording::{is_recorded, note};

/// Makes a folder and those above it that are not there.
///
/// # Errors
/// What the system says.
pub fn create_dir_all(path: &Path) -> io::Result<()> {
    let mut missing: Vec<&Path> = Vec::new();
    if is_recorded() {
        missing.extend(path.ancestors().take_while(|above| !above.as_os_str().is_empty() && !above.exists()));
    }
    fs::create_dir_all(path)?;
    missing.iter().rev().for_each(|folder| note(|| DiskOperation::CreateFolder((*folder).into())));
    Ok(())
}

/// Gives a file or folder another name; a file that has it is replaced. The new name is brought to the disk.
///
/// # Errors
/// What the system says.
pub fn rename(from: &Path, to: &Path) -> io::Result<()> {
    fs::rename(from, to)?;
    note(|| DiskOperation::Rename { from: from.into(), to: to.into() });
    // Where folders can be opened; elsewhere the rename is all there is.
    if let Some(Ok(folder)) = to.parent().map(File::open) {
        let _ = folder.sync_all();
    }
    Ok(())
}

/// Gives a file a second name.
///
/// # Errors
/// What the system says.
pub fn hard_link(from: &Path, to: &Path) -> io::Result<()> {
    fs::hard_link(from, to)?;
    note(|| DiskOperation::Link { from: from.into(), to: to.into() });
    Ok(())
}

/// Removes a file.
///
/// # Errors
/// What the system says.
pub fn remove_file(path: &Path) -> io::Result<()> {
    fs::remove_file(path)?;
    note(|| DiskOperation::Remove(path.into()));
    Ok(())
}

/// Removes an empty folder.
///
/// # Errors
/// What the system says.
pub fn remove_dir(path: &Path) -> io::Result<()> {
    fs::remove_dir(path)?;
    note(|| DiskOperation::Remove(path.into()));
    Ok(())
}

/// Removes a folder and all that is in it.
///
/// # Errors
/// What the system says.
pub fn remove_dir_all(path: &Path) -> io::Result<()> {
    if !is_recorded() || path.is_symlink() {
        return fs::remove_dir_all(path);
    }
    // As the system does it, so that each step is written down.
    for entry in fs::read_dir(path)? {
        let entry = entry?;
        match entry.file_type()?.is_dir() {
            true => remove_dir_all(&entry.path())?,
            false => remove_file(&entry.path())?,
        }
    }
    remove_dir(path)
}

//! The layer through which everything is written to a disk: files, names and folders.
//!
//! The functions are those of [`std::fs`]. Their operations can be [recorded](DiskRecording), so that a test can put
//! a disk into every state that a power cut would leave.
//!
//! In the folder:
//!
//! - `disk_file`: an open file that is written through this layer.

mod disk_file;

use std::{
    ffi::OsStr,
    fs,
    fs::File,
    io,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

pub use crate::disk::disk_file::DiskFile;

/// Writes `bytes` to `path` so that a reader sees the old contents or the new, never a part. The file gets a
/// temporary name first, is flushed to the disk, then renamed.
///
/// # Errors
/// The system's error; the old contents are still there, and nothing else.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_atomically_with(path, |file| file.write_all(bytes))
}

/// Writes atomically, as [`write_atomically`], contents that `write` produces piece by piece.
///
/// # Errors
/// The error of the system or of `write`; the old contents are still there, and nothing else.
pub fn write_atomically_with(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<DiskFile>) -> io::Result<()>,
) -> io::Result<()> {
    let temporary = temporary_name(path);
    let written = DiskFile::create(&temporary).and_then(|file| {
        let mut file = BufWriter::new(file);
        write(&mut file)?;
        file.flush()?;
        file.get_ref().sync()?;
        rename(&temporary, path)
    });
    if written.is_err() {
        // The first error is the one to report.
        let _ = remove_file(&temporary);
    }
    written
}

// Operations on names and folders, with the errors of the system.

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

// Temporary names of unfinished files, and removal of those that killed processes have left.

/// Text between the name of a file and the number of the process that writes it.
const MARK: &str = ".tmp";

/// Returns the name under which this process writes a file before it is renamed, in the same folder.
pub fn temporary_name(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!("{MARK}{}", std::process::id()));
    path.with_file_name(name)
}

/// Returns whether this is the name of a file that some process has not finished writing.
fn is_temporary(name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    let Some((file, process)) = name.rsplit_once(MARK) else { return false };
    // A number alone, without a sign.
    !file.is_empty() && process.bytes().all(|byte| byte.is_ascii_digit()) && process.parse::<u32>().is_ok()
}

/// Removes unfinished files of killed processes from a folder, without its subfolders. Returns their names; a missing
/// folder has none.
///
/// Only for a caller that alone may write there: a process that still writes could not finish.
///
/// # Errors
/// The system's error.
pub fn remove_temporaries(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut left = Vec::new();
    for entry in entries {
        let entry = entry?;
        if is_temporary(&entry.file_name()) && entry.file_type()?.is_file() {
            left.push(entry.path());
        }
    }
    left.sort();
    left.iter().try_for_each(|file| remove_file(file))?;
    Ok(left)
}

// Recording of disk operations, for tests.

/// One change of a disk, after it was made. Paths are as the program named them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DiskOperation {
    /// A folder was made.
    CreateFolder(PathBuf),
    /// An empty file was made.
    Create(PathBuf),
    /// Bytes were written into a file.
    Write {
        /// The file.
        path: PathBuf,
        /// Position of the first byte.
        at: u64,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// A file was cut or made longer.
    SetLength {
        /// The file.
        path: PathBuf,
        /// Its length in bytes.
        length: u64,
    },
    /// The contents of a file were flushed to the disk, so a power cut cannot undo them.
    Sync(PathBuf),
    /// A file or folder was renamed; a file at the new name is gone.
    Rename {
        /// The old name.
        from: PathBuf,
        /// The new name.
        to: PathBuf,
    },
    /// A file has a second name.
    Link {
        /// The first name.
        from: PathBuf,
        /// The second name.
        to: PathBuf,
    },
    /// A file or an empty folder was removed.
    Remove(PathBuf),
}

impl DiskOperation {
    /// Returns the changed path; the new name where there are two.
    pub fn path(&self) -> &Path {
        match self {
            Self::CreateFolder(path) | Self::Create(path) | Self::Sync(path) | Self::Remove(path) => path,
            Self::Write { path, .. } | Self::SetLength { path, .. } => path,
            Self::Rename { to, .. } | Self::Link { to, .. } => to,
        }
    }
}

/// Number of active recordings. Without any, checking it is the only cost.
static ACTIVE: AtomicUsize = AtomicUsize::new(0);

static RECORDINGS: Mutex<Vec<Arc<Notes>>> = Mutex::new(Vec::new());

#[derive(Debug)]
struct Notes {
    folder: PathBuf,
    operations: Mutex<Vec<DiskOperation>>,
}

/// Records the operations of this process below a folder through [this module](super), until it is dropped. It is for
/// tests and changes nothing.
#[derive(Debug)]
pub struct DiskRecording(Arc<Notes>);

impl DiskRecording {
    /// Starts with the next operation whose path begins with that of `folder`.
    pub fn of(folder: &Path) -> Self {
        let notes = Arc::new(Notes { folder: folder.into(), operations: Mutex::default() });
        unpoisoned(&RECORDINGS).push(Arc::clone(&notes));
        ACTIVE.fetch_add(1, Ordering::Relaxed);
        Self(notes)
    }

    /// Returns the operations so far, in the order in which they were made.
    pub fn operations(&self) -> Vec<DiskOperation> {
        unpoisoned(&self.0.operations).clone()
    }
}

impl Drop for DiskRecording {
    fn drop(&mut self) {
        ACTIVE.fetch_sub(1, Ordering::Relaxed);
        unpoisoned(&RECORDINGS).retain(|notes| !Arc::ptr_eq(notes, &self.0));
    }
}

/// Returns whether any recording is active.
fn is_recorded() -> bool {
    ACTIVE.load(Ordering::Relaxed) > 0
}

/// Adds an operation to all recordings; it is built only if there are any.
fn note(operation: impl FnOnce() -> DiskOperation) {
    if !is_recorded() {
        return;
    }
    let operation = operation();
    for notes in unpoisoned(&RECORDINGS).iter().filter(|notes| operation.path().starts_with(&notes.folder)) {
        unpoisoned(&notes.operations).push(operation.clone());
    }
}

fn unpoisoned<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_file_that_cannot_be_finished_leaves_the_old_one_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.json");
        write_atomically_with(&path, |file| file.write_all(b"whole")).expect("writable");
        let failed = write_atomically_with(&path, |file| {
            file.write_all(b"ha")?;
            Err(io::Error::other("the disk is full"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read_to_string(&path).expect("readable"), "whole");
        assert_eq!(fs::read_dir(folder.path()).expect("readable").count(), 1);
    }

    #[test]
    fn only_files_that_a_process_left_unfinished_are_removed() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        let own = temporary_name(&path("a.json"));
        let names = [
            "run.json.tmp1",
            "a.tmp.tmp4294967295",
            "a.tmp",
            "a.tmp-1",
            "a.tmp+1",
            "a.tmp1x",
            ".tmp7",
            "b.tmp4294967296",
        ];
        names.iter().for_each(|name| fs::write(path(name), "half").expect("writable"));
        fs::write(&own, "half").expect("writable");
        fs::create_dir(path("folder.tmp5")).expect("writable");
        fs::write(path("folder.tmp5/a.tmp6"), "below").expect("writable");
        let mut expected = vec![path(names[0]), path(names[1]), own];
        expected.sort();
        assert_eq!(remove_temporaries(folder.path()).expect("writable"), expected);
        assert!(expected.iter().all(|file| !file.exists()));
        assert!(names[2..].iter().all(|name| path(name).exists()) && path("folder.tmp5/a.tmp6").exists());
        assert_eq!(remove_temporaries(&path("none")).expect("nothing is there"), Vec::<PathBuf>::new());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_left_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let (file, link) = (folder.path().join("file"), folder.path().join("link.tmp8"));
        fs::write(&file, "somebody's").expect("writable");
        std::os::unix::fs::symlink(&file, &link).expect("writable");
        assert!(remove_temporaries(folder.path()).expect("readable").is_empty() && link.is_symlink());
    }
}

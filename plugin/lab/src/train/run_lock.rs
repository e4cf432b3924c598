//! One process at a time trains in a folder.

use std::{
    fs::{File, OpenOptions, TryLockError},
    io,
    path::{Path, PathBuf},
    thread,
};

use playbot_learner::disk::DiskFile;

use super::run_dir::{RunError, io_error};

/// Name of the file that is locked. It stays when the lock is given back, and says nothing then.
pub(super) const LOCK_FILE: &str = "run.lock";

/// Tries before a lock is somebody else's: who only looks, with [`RunLock::is_taken`], has it for a moment.
const TRIES: usize = 1000;

/// The right to write into the folder of a run, until it is dropped. The system gives it back when the process ends,
/// however it ends, so that a kill leaves nothing in the way. Who only reads needs none.
#[derive(Debug)]
pub struct RunLock {
    folder: PathBuf,
    _file: DiskFile,
}

impl RunLock {
    /// Takes the lock of a folder that exists.
    ///
    /// # Errors
    ///
    /// [`RunError::Busy`] if somebody has it; [`RunError::Io`] if the folder cannot be written.
    pub fn take(folder: &Path) -> Result<Self, RunError> {
        let path = folder.join(LOCK_FILE);
        let file = DiskFile::open(&path, OpenOptions::new().create(true).truncate(false).write(true));
        let file = file.map_err(io_error("open", &path))?;
        match try_often(file.as_file()) {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(RunError::Busy(folder.into())),
            // Some network file systems have no locks.
            Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {
                tracing::warn!("{} cannot be locked: make sure that nothing else trains there", folder.display());
            }
            Err(TryLockError::Error(error)) => return Err(io_error("lock", &path)(error)),
        }
        Ok(Self { folder: folder.into(), _file: file })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether somebody has the lock of a folder now. Nothing is written.
    pub fn is_taken(folder: &Path) -> bool {
        let is_taken = |file: File| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock));
        File::open(folder.join(LOCK_FILE)).is_ok_and(is_taken)
    }

    /// Whether a folder has been locked once, and so is one of ours.
    pub fn is_known(folder: &Path) -> bool {
        folder.join(LOCK_FILE).is_file()
    }
}

fn try_often(file: &File) -> Result<(), TryLockError> {
    for _ in 1..TRIES {
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => thread::yield_now(),
            decided => return decided,
        }
    }
    file.try_lock()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_one_lock() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(!RunLock::is_taken(folder.path()));
        assert!(!RunLock::is_known(folder.path()), "who looks writes nothing");
        let lock = RunLock::take(folder.path()).expect("free");
        assert!(matches!(RunLock::take(folder.path()), Err(RunError::Busy(path)) if path == folder.path()));
        assert!(RunLock::is_taken(folder.path()));
        drop(lock);
        assert!(!RunLock::is_taken(folder.path()));
        assert!(RunLock::is_known(folder.path()));
        RunLock::take(folder.path()).expect("free again");
    }
}

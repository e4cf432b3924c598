//! One process at a time trains in a folder.

use std::{
    fs::{File, OpenOptions, TryLockError},
    io,
    path::{Path, PathBuf},
};

use super::run_dir::{RunError, io_error};

/// Name of the file that is locked. It stays when the lock is given back, and says nothing then.
pub(super) const LOCK_FILE: &str = "run.lock";

/// The right to write into the folder of a run, until it is dropped. The system gives it back when the process ends,
/// however it ends, so that a kill leaves nothing in the way. Who only reads needs none.
#[derive(Debug)]
pub struct RunLock {
    folder: PathBuf,
    _file: File,
}

impl RunLock {
    /// Takes the lock of a folder that exists.
    ///
    /// # Errors
    ///
    /// [`RunError::Busy`] if somebody has it; [`RunError::Io`] if the folder cannot be written.
    pub fn take(folder: &Path) -> Result<Self, RunError> {
        let path = folder.join(LOCK_FILE);
        let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path);
        let file = file.map_err(io_error("open", &path))?;
        match file.try_lock() {
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

    /// Whether a folder has been locked once, and so is one of ours.
    pub fn is_known(folder: &Path) -> bool {
        folder.join(LOCK_FILE).is_file()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_one_lock() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(!RunLock::is_known(folder.path()));
        let lock = RunLock::take(folder.path()).expect("free");
        assert!(matches!(RunLock::take(folder.path()), Err(RunError::Busy(path)) if path == folder.path()));
        drop(lock);
        assert!(RunLock::is_known(folder.path()));
        RunLock::take(folder.path()).expect("free again");
    }
}

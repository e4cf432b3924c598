//! The file operations of the writer: writing, synchronising, truncating, locking.

use std::fs::{File, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};

use playbot_learner::disk::DiskFile;

use super::error::DemoFault;

/// The file operations of the writer; tests substitute a disk that fills up.
pub(super) trait Store: Write + Send + Sync {
    fn sync(&mut self) -> io::Result<()>;
    fn cut(&mut self, length: u64) -> io::Result<()>;
}

impl Store for DiskFile {
    fn sync(&mut self) -> io::Result<()> {
        match DiskFile::sync(self) {
            // Devices and pipes cannot be synchronised, and need not be.
            Err(e) if e.kind() == io::ErrorKind::InvalidInput => Ok(()),
            other => other,
        }
    }

    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)?;
        self.seek(SeekFrom::Start(length)).map(drop)
    }
}

/// Locks the file against other writers, where the file system can.
pub(super) fn lock(file: &File) -> Result<(), DemoFault> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(DemoFault::Locked),
        // File systems without locks are used without them.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    /// A disk with limited room.
    #[derive(Clone)]
    pub(in super::super) struct SmallDisk {
        pub bytes: Arc<Mutex<Vec<u8>>>,
        pub room: usize,
        pub can_cut: bool,
    }

    impl Write for SmallDisk {
        fn write(&mut self, data: &[u8]) -> io::Result<usize> {
            let mut bytes = self.bytes.lock().expect("one thread");
            let fits = data.len().min(self.room - bytes.len());
            bytes.extend_from_slice(&data[..fits]);
            if fits == 0 { Err(io::ErrorKind::StorageFull.into()) } else { Ok(fits) }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Store for SmallDisk {
        fn sync(&mut self) -> io::Result<()> {
            Ok(())
        }

        fn cut(&mut self, length: u64) -> io::Result<()> {
            if !self.can_cut {
                return Err(io::ErrorKind::PermissionDenied.into());
            }
            self.bytes.lock().expect("one thread").truncate(length as usize);
            Ok(())
        }
    }
}

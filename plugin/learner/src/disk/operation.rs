//! Operations on a disk.

use std::path::{Path, PathBuf};

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

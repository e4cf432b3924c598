//! An open file that is written through [the recording layer](super).

use crate::disk::{DiskOperation, is_recorded, note};
use std::{
    fs,
    fs::{File, OpenOptions},
    io,
    io::{Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

/// A [`File`] to write, with the path it was opened at.
#[derive(Debug)]
pub struct DiskFile {
    file: File,
    path: PathBuf,
}

impl DiskFile {
    /// Opens a file.
    ///
    /// # Errors
    /// The system's error.
    pub fn open(path: &Path, options: &OpenOptions) -> io::Result<Self> {
        let length_before = is_recorded().then(|| fs::metadata(path).map(|metadata| metadata.len()).ok());
        let file = options.open(path)?;
        match length_before {
            Some(None) => note(|| DiskOperation::Create(path.into())),
            Some(Some(length)) if length > 0 && file.metadata()?.len() == 0 => {
                note(|| DiskOperation::SetLength { path: path.into(), length: 0 });
            }
            _ => {}
        }
        Ok(Self { file, path: path.into() })
    }

    /// Opens an empty file to write; old contents are lost.
    ///
    /// # Errors
    /// The system's error.
    pub fn create(path: &Path) -> io::Result<Self> {
        Self::open(path, OpenOptions::new().write(true).create(true).truncate(true))
    }

    /// Opens a new file to write.
    ///
    /// # Errors
    /// The system's error, also if the file exists.
    pub fn create_new(path: &Path) -> io::Result<Self> {
        Self::open(path, OpenOptions::new().write(true).create_new(true))
    }

    /// Opens a file to append to, and creates it if it does not exist.
    ///
    /// # Errors
    /// The system's error.
    pub fn append(path: &Path) -> io::Result<Self> {
        Self::open(path, OpenOptions::new().create(true).append(true))
    }

    /// Returns the file, to read it, to lock it, and to ask for its length.
    pub fn as_file(&self) -> &File {
        &self.file
    }

    /// Truncates the file, or extends it with zeros.
    ///
    /// # Errors
    /// The system's error.
    pub fn set_len(&self, length: u64) -> io::Result<()> {
        self.file.set_len(length)?;
        note(|| DiskOperation::SetLength { path: self.path.clone(), length });
        Ok(())
    }

    /// Renames the file; a file at the new name is replaced. See [`rename`](crate::disk::rename).
    ///
    /// # Errors
    /// The system's error; the file has its old name then.
    pub fn rename_to(&mut self, path: &Path) -> io::Result<()> {
        crate::disk::rename(&self.path, path)?;
        self.path = path.into();
        Ok(())
    }

    /// Waits until the contents are on the disk.
    ///
    /// # Errors
    /// The system's error.
    pub fn sync(&self) -> io::Result<()> {
        self.file.sync_all()?;
        note(|| DiskOperation::Sync(self.path.clone()));
        Ok(())
    }
}

impl Write for DiskFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        if is_recorded() {
            // Files that are appended to are at their end only after the write.
            let at = self.file.stream_position()? - written as u64;
            note(|| DiskOperation::Write { path: self.path.clone(), at, bytes: bytes[..written].into() });
        }
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Read for DiskFile {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.file.read(bytes)
    }
}

impl Seek for DiskFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

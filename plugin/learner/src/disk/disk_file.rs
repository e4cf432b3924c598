//! An open file.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::DiskOperation;
use super::recording::{is_recorded, note};

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
    /// What the system says.
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

    /// Opens an empty file to write; what was in it is gone.
    ///
    /// # Errors
    /// What the system says.
    pub fn create(path: &Path) -> io::Result<Self> {
        Self::open(path, OpenOptions::new().write(true).create(true).truncate(true))
    }

    /// Opens a file to write that is not there yet.
    ///
    /// # Errors
    /// What the system says, also that the file is there.
    pub fn create_new(path: &Path) -> io::Result<Self> {
        Self::open(path, OpenOptions::new().write(true).create_new(true))
    }

    /// Opens a file to write behind what is in it, and makes it if it is not there.
    ///
    /// # Errors
    /// What the system says.
    pub fn append(path: &Path) -> io::Result<Self> {
        Self::open(path, OpenOptions::new().create(true).append(true))
    }

    /// To read it, to lock it, and to ask for its length.
    pub fn as_file(&self) -> &File {
        &self.file
    }

    /// Cuts the file, or makes it longer with zeros.
    ///
    /// # Errors
    /// What the system says.
    pub fn set_len(&self, length: u64) -> io::Result<()> {
        self.file.set_len(length)?;
        note(|| DiskOperation::SetLength { path: self.path.clone(), length });
        Ok(())
    }

    /// Gives the file another name; a file that has it is replaced. See [`rename`](super::rename).
    ///
    /// # Errors
    /// What the system says; the file has its old name then.
    pub fn rename_to(&mut self, path: &Path) -> io::Result<()> {
        super::rename(&self.path, path)?;
        self.path = path.into();
        Ok(())
    }

    /// Waits until the contents are on the disk.
    ///
    /// # Errors
    /// What the system says.
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
            // Files that are appended to stand at their end only afterwards.
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

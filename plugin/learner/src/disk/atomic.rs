//! Atomic writes: files that are complete or absent.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::{DiskFile, remove_file, rename, temporary_name};

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
}

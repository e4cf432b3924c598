//! Safe reading of text files of unknown origin.

use std::{
    fs::{self, File},
    io::{self, Read},
    path::Path,
};

use thiserror::Error;

/// Failure to read a file as text.
#[derive(Debug, Error)]
pub enum TextFileError {
    /// The operating system refused.
    #[error(transparent)]
    Unreadable(#[from] io::Error),
    /// Not a regular file.
    #[error("it is a folder, a pipe or a device, not a regular file")]
    NotAFile,
    /// The file is larger than any file of its kind.
    #[error("it has {bytes} bytes, and such a file has at most {most}: name another file")]
    TooLarge {
        /// Size, as far as it was read.
        bytes: u64,
        /// Largest size of a file of its kind, bytes.
        most: u64,
    },
    /// The file is not UTF-8.
    #[error("line {line}: byte {byte} of the line is not UTF-8: save it as UTF-8, or name another file")]
    NoText {
        /// Line, from 1.
        line: usize,
        /// Byte of the line, from 1.
        byte: usize,
    },
}

impl From<TextFileError> for io::Error {
    fn from(error: TextFileError) -> Self {
        match error {
            TextFileError::Unreadable(error) => error,
            other => Self::new(io::ErrorKind::InvalidData, other.to_string()),
        }
    }
}

/// Returns the text of a regular file of at most `most` bytes. Neither waits nor takes more memory, whatever the path
/// is.
///
/// # Errors
///
/// [`TextFileError`].
pub(crate) fn read_text_file(path: &Path, most: u64) -> Result<String, TextFileError> {
    // Opening a pipe would wait for a writer.
    if !fs::metadata(path)?.is_file() {
        return Err(TextFileError::NotAFile);
    }
    let file = File::open(path)?;
    let bytes = file.metadata()?.len();
    if bytes > most {
        return Err(TextFileError::TooLarge { bytes, most });
    }
    let mut read = Vec::new();
    // Some files report no size.
    file.take(most.saturating_add(1)).read_to_end(&mut read)?;
    if read.len() as u64 > most {
        return Err(TextFileError::TooLarge { bytes: read.len() as u64, most });
    }
    String::from_utf8(read).map_err(|error| {
        let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
        let byte = 1 + before.iter().rev().take_while(|&&byte| byte != b'\n').count();
        TextFileError::NoText { line, byte }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_read_up_to_its_limit_and_not_beyond() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.txt");
        fs::write(&path, "four").expect("writable");
        assert_eq!(read_text_file(&path, 4).expect("four bytes"), "four");
        let error = read_text_file(&path, 3).expect_err("too long").to_string();
        assert_eq!(error, "it has 4 bytes, and such a file has at most 3: name another file");
        fs::write(&path, b"a\nbc\xff").expect("writable");
        let error = read_text_file(&path, 100).expect_err("no text").to_string();
        assert!(error.starts_with("line 2: byte 3 of the line"), "{error}");
        assert!(matches!(read_text_file(folder.path(), 100), Err(TextFileError::NotAFile)));
    }
}

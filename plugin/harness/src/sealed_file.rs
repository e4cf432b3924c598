//! Files with a checksum over their content, see [`playbot_learner::seal_json`], and checksums of whole files.

use playbot_learner::{BrokenSeal, HasExitCode, Unsealed, disk, seal_json, unseal_json, unseal_text};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::json;
use std::{
    fs, io,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// Failure to read or write a file.
#[derive(Debug, Error)]
pub enum SealedFileError {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// The failed action.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// The file is damaged.
    #[error("{}: {message}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The damage.
        message: String,
    },
}

impl HasExitCode for SealedFileError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Io { .. } => 2,
            Self::Damaged { .. } => 3,
        }
    }
}

/// Makes the error of a failed action on a file.
pub fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> SealedFileError {
    move |source| SealedFileError::Io { action, path: path.into(), source }
}

/// Makes the error of a damaged file.
pub fn damaged(path: &Path, message: &impl ToString) -> SealedFileError {
    SealedFileError::Damaged { path: path.into(), message: message.to_string() }
}

/// Writes a value with its checksum, atomically. The value must serialise to a JSON object that is not empty.
///
/// # Errors
///
/// [`SealedFileError::Io`].
pub fn write_sealed(path: &Path, value: &impl Serialize) -> Result<(), SealedFileError> {
    write_atomically(path, seal_json(&json!(value).to_string()).as_bytes())
}

/// Writes a file under a temporary name, flushes it to the disk and renames it. So the file has the old or the new
/// content, never a part.
///
/// # Errors
///
/// [`SealedFileError::Io`].
pub fn write_atomically(path: &Path, content: &[u8]) -> Result<(), SealedFileError> {
    playbot_learner::write_atomically(path, content).map_err(io_error("write", path))
}

/// Reads a value that [`write_sealed`] wrote, and returns whether it had a checksum: older versions wrote none.
///
/// # Errors
///
/// [`SealedFileError::Io`], or [`SealedFileError::Damaged`] with the line if it is not JSON of this type.
pub fn read_sealed<T: DeserializeOwned>(path: &Path) -> Result<(T, bool), SealedFileError> {
    let bytes = fs::read(path).map_err(io_error("read", path))?;
    let Unsealed { text, had_seal } = unsealed(bytes, unseal_json).map_err(|message| damaged(path, &message))?;
    let value = serde_json::from_str(&text).map_err(|error| damaged(path, &error))?;
    Ok((value, had_seal))
}

/// Checks that a text with its checksum on the first line is unchanged. A file that cannot be read passes: its reader
/// reports it.
///
/// # Errors
///
/// [`SealedFileError::Damaged`].
pub fn check_text_seal(path: &Path) -> Result<(), SealedFileError> {
    let Ok(bytes) = fs::read(path) else { return Ok(()) };
    unsealed(bytes, unseal_text).map(drop).map_err(|message| damaged(path, &message))
}

/// Returns a line of a journal without its checksum; `None` if the checksum is wrong, or the line is not text.
pub fn unsealed_line(line: &[u8]) -> Option<Unsealed> {
    unseal_json(std::str::from_utf8(line).ok()?).ok()
}

/// Returns the text of a file, whose bytes may be damaged.
fn unsealed(bytes: Vec<u8>, unseal: fn(&str) -> Result<Unsealed, BrokenSeal>) -> Result<Unsealed, String> {
    let text = String::from_utf8(bytes).map_err(|error| {
        format!("the file is damaged: it is not text from byte {} on", error.utf8_error().valid_up_to())
    })?;
    unseal(&text).map_err(|error| error.to_string())
}

/// Returns the CRC-32 (the one of zip, ISO-HDLC) of a file's bytes as eight hexadecimal digits, which identifies a
/// policy or a skill model.
///
/// # Errors
///
/// [`SealedFileError::Io`].
pub fn file_checksum(path: &Path) -> Result<String, SealedFileError> {
    let bytes = fs::read(path).map_err(io_error("read", path))?;
    Ok(format!("{:08x}", crc32fast::hash(&bytes)))
}

/// Removes the unfinished files of killed processes from a folder, with a warning for each. Nothing depends on
/// success. Only for the one process that may write there.
pub fn remove_temporaries(folder: &Path) {
    match disk::remove_temporaries(folder) {
        Ok(files) => files.iter().for_each(|file| {
            tracing::warn!("{} is unfinished, since its process was killed, and is removed", file.display());
        }),
        Err(error) => tracing::warn!("the unfinished files in {} cannot be removed: {error}", folder.display()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damage_is_seen_and_older_files_are_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.json");
        write_sealed(&path, &json!({ "step": 8 })).expect("writable");
        let whole = fs::read(&path).expect("written");
        assert_eq!(read_sealed::<serde_json::Value>(&path).expect("whole"), (json!({ "step": 8 }), true));
        for at in 0..whole.len() * 8 {
            let mut bytes = whole.clone();
            bytes[at / 8] ^= 1 << (at % 8);
            fs::write(&path, bytes).expect("writable");
            let error = read_sealed::<serde_json::Value>(&path).expect_err("damaged").to_string();
            assert!(error.contains("a.json: the file is damaged"), "{at}: {error}");
        }
        fs::write(&path, r#"{"step":9}"#).expect("writable");
        assert_eq!(read_sealed::<serde_json::Value>(&path).expect("older"), (json!({ "step": 9 }), false));
    }

    #[test]
    fn the_checksum_is_that_of_the_bytes() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        fs::write(&file, "123456789").expect("writable");
        assert_eq!(file_checksum(&file).expect("readable"), "cbf43926", "the check value of the standard");
        let error = file_checksum(&folder.path().join("none")).expect_err("not there").to_string();
        assert!(error.starts_with("cannot read ") && error.contains("none"), "{error}");
    }
}

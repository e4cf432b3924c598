//! Files with a checksum over what they say, see [`playbot_learner::seal_json`].

use std::{fs, path::Path};

use playbot_learner::{BrokenSeal, Unsealed, seal_json, unseal_json, unseal_text};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::json;

use super::run_error::{RunError, damaged, edited, io_error};

/// Writes a value, which must become a JSON object with an entry, and its checksum: whole or not at all.
///
/// # Errors
///
/// [`RunError::Io`].
pub fn write_sealed(path: &Path, value: &impl Serialize) -> Result<(), RunError> {
    let text = seal_json(&json!(value).to_string());
    playbot_learner::write_atomically(path, text.as_bytes()).map_err(io_error("write", path))
}

/// Reads what [`write_sealed`] wrote, and whether it had a checksum: older versions wrote none.
///
/// # Errors
///
/// [`RunError::Io`], or [`RunError::Damaged`] with the line if it is no JSON of this kind.
pub fn read_sealed<T: DeserializeOwned>(path: &Path) -> Result<(T, bool), RunError> {
    let bytes = fs::read(path).map_err(io_error("read", path))?;
    let Unsealed { text, had_seal } = unsealed(bytes, unseal_json).map_err(|message| damaged(path, &message))?;
    let value = serde_json::from_str(&text).map_err(|error| damaged(path, &error))?;
    Ok((value, had_seal))
}

/// Checks that the experiment of a run, a text with its checksum on the first line, is the one that was written.
pub(super) fn check_text_seal(path: &Path) -> Result<(), RunError> {
    // Whoever reads it says what is wrong if it cannot be read.
    let Ok(bytes) = fs::read(path) else { return Ok(()) };
    unsealed(bytes, unseal_text).map(drop).map_err(|message| edited(path, &message))
}

/// A line of a journal without its checksum; `None` if that is not the right one, or the line is no text.
pub(crate) fn unsealed_line(line: &[u8]) -> Option<Unsealed> {
    unseal_json(std::str::from_utf8(line).ok()?).ok()
}

/// The text of a file, whose bytes may be no text any more.
fn unsealed(bytes: Vec<u8>, unseal: fn(&str) -> Result<Unsealed, BrokenSeal>) -> Result<Unsealed, String> {
    let text = String::from_utf8(bytes).map_err(|error| {
        format!("the file is damaged: it is no text from byte {} on", error.utf8_error().valid_up_to())
    })?;
    unseal(&text).map_err(|error| error.to_string())
}

/// Says once of a run that nobody can tell whether its files are damaged.
pub(super) fn warn_of_no_seal(path: &Path) {
    tracing::warn!(
        "{} was written by an older version and has no checksum: damage to it would not be seen",
        path.display()
    );
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
}

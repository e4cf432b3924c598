//! Files with one line of JSON per update, whose end a crash can tear.

use std::{
    fs,
    io::{self, Write},
    path::Path,
};

use playbot_learner::{disk::DiskFile, seal_json};
use serde_json::Value;

use crate::sealed_file::unsealed_line;

/// One line.
#[derive(Clone, Debug, PartialEq)]
pub struct JsonLine {
    /// Its text as written, with its checksum if any, and without the line feed.
    pub text: String,
    /// Its `step`.
    pub step: u64,
    /// Its JSON value.
    pub value: Value,
    /// True if it has a checksum, which older versions did not write.
    pub had_seal: bool,
}

/// Content of a file of JSON lines.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JsonLines {
    /// The whole lines, in their order.
    pub lines: Vec<JsonLine>,
    /// Numbers, from 1, of lines that are not JSON, lack a step, or have a wrong checksum.
    pub damaged: Vec<usize>,
    /// True if the last line has no end, as after a crash.
    pub is_torn: bool,
}

impl JsonLines {
    /// Reads a file; a missing one is empty.
    ///
    /// # Errors
    ///
    /// The operating system refuses.
    pub fn read(path: &Path) -> io::Result<Self> {
        let bytes = match fs::read(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            other => other?,
        };
        let mut found = Self { is_torn: bytes.last().is_some_and(|byte| *byte != b'\n'), ..Self::default() };
        for (index, line) in bytes.split(|byte| *byte == b'\n').enumerate().filter(|(_, line)| !line.is_empty()) {
            match parse(line) {
                Some(line) => found.lines.push(line),
                None => found.damaged.push(index + 1),
            }
        }
        Ok(found)
    }
}

fn parse(line: &[u8]) -> Option<JsonLine> {
    let unsealed = unsealed_line(line)?;
    let text = String::from_utf8(line.to_vec()).ok()?;
    let value: Value = serde_json::from_str(&unsealed.text).ok()?;
    Some(JsonLine { step: value["step"].as_u64()?, text, value, had_seal: unsealed.had_seal })
}

/// Appends one line with its checksum, with one write.
///
/// # Errors
///
/// The operating system refuses.
pub fn append_json_line(path: &Path, line: &Value) -> io::Result<()> {
    DiskFile::append(path)?.write_all(format!("{}\n", seal_json(&line.to_string())).as_bytes())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn torn_lines_are_named_and_the_others_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jsonl");
        assert_eq!(JsonLines::read(&path).expect("empty"), JsonLines::default());
        append_json_line(&path, &json!({ "step": 8, "a": 0.1 })).expect("writable");
        let mut bytes = fs::read(&path).expect("written");
        bytes.extend(b"{\"step\": 16}\n{\"a\": 1}\n{\"step\":24,\"a\":\xff");
        fs::write(&path, bytes).expect("writable");
        let read = JsonLines::read(&path).expect("readable");
        assert_eq!(read.lines.iter().map(|line| line.step).collect::<Vec<_>>(), [8, 16]);
        assert_eq!((&read.lines[0].value, read.lines[0].had_seal), (&json!({ "step": 8, "a": 0.1 }), true));
        assert!(!read.lines[1].had_seal && read.is_torn);
        assert_eq!(read.damaged, [3, 4], "without a step; torn within a character");
    }
    #[test]
    fn no_flipped_bit_is_accepted() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jsonl");
        for step in [8, 16] {
            append_json_line(&path, &json!({ "step": step, "charts/a": 0.25 })).expect("writable");
        }
        let whole = fs::read(&path).expect("written");
        let lines = JsonLines::read(&path).expect("readable").lines;
        for at in 0..(whole.len() - 1) * 8 {
            let mut bytes = whole.clone();
            bytes[at / 8] ^= 1 << (at % 8);
            fs::write(&path, bytes).expect("writable");
            let read = JsonLines::read(&path).expect("readable");
            assert!(read.lines.iter().all(|line| lines.contains(line)) && !read.damaged.is_empty(), "bit {at}");
        }
    }
}

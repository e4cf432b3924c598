//! Files with one line of JSON per update, which a crash can tear at their end.

use std::{
    fs::{self, OpenOptions},
    io::{self, Write},
    path::Path,
};

use serde_json::Value;

/// One line.
#[derive(Clone, Debug, PartialEq)]
pub struct JsonLine {
    /// Its text, without the line feed.
    pub text: String,
    /// Its `step`.
    pub step: u64,
    /// What it says.
    pub value: Value,
}

/// What a file of JSON lines holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JsonLines {
    /// The whole lines, in their order.
    pub lines: Vec<JsonLine>,
    /// Numbers, from 1, of the lines that are no JSON or have no step: the last one after a crash.
    pub damaged: Vec<usize>,
}

impl JsonLines {
    /// Reads a file; one that does not exist is empty.
    ///
    /// # Errors
    ///
    /// The operating system refuses.
    pub fn read(path: &Path) -> io::Result<Self> {
        let bytes = match fs::read(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            other => other?,
        };
        let mut found = Self::default();
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
    let text = String::from_utf8(line.to_vec()).ok()?;
    let value: Value = serde_json::from_str(&text).ok()?;
    Some(JsonLine { step: value["step"].as_u64()?, text, value })
}

/// Appends one line with one write.
///
/// # Errors
///
/// The operating system refuses.
pub fn append_json_line(path: &Path, line: &Value) -> io::Result<()> {
    let mut file = OpenOptions::new().create(true).append(true).open(path)?;
    file.write_all(format!("{line}\n").as_bytes())
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
        assert_eq!(read.lines[0].text, r#"{"a":0.1,"step":8}"#);
        assert_eq!(read.damaged, [3, 4], "without a step; torn within a character");
    }
}

//! The file `results.json`: the description of a test, and a line for each level.
//!
//! The file is one JSON object whose levels stand one to a line. So files of any length are read and joined without
//! holding them in memory.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Write},
    path::{Path, PathBuf},
};

use crc32fast::Hasher;
use playbot_learner::BrokenSeal;
use serde_json::Value;

use super::{
    error::{TestError, io_error, json_fault},
    level_verdict::LevelVerdict,
    plan::TestRecord,
};

/// Name of the file in the folder of a test.
pub const RESULTS: &str = "results.json";
/// Text between the description and the first level.
const LEVELS: &str = ",\"levels\":[";
/// Text after the last level in files of older versions.
const END: &str = "]}";

/// Returns the text after the last level, with the checksum of all bytes of the lines before.
fn end(hasher: &Hasher) -> String {
    format!("],\"crc32\":\"{:08x}\"}}", hasher.clone().finalize())
}

/// Returns the folder of results, given the folder or the file in it.
pub fn results_folder(named: &Path) -> &Path {
    let is_file = named.file_name().is_some_and(|name| name == RESULTS) && named.is_file();
    match named.parent() {
        Some(folder) if is_file && folder.as_os_str().is_empty() => Path::new("."),
        Some(folder) if is_file => folder,
        _ => named,
    }
}

/// Writer of results, a level at a time.
pub(super) struct ResultWriter<W> {
    out: W,
    is_first: bool,
    hasher: Hasher,
}

impl<W: Write> ResultWriter<W> {
    /// Begins with the description of the test.
    pub fn begin(out: W, record: &TestRecord) -> io::Result<Self> {
        let head = serde_json::to_string(record)?;
        let mut results = Self { out, is_first: true, hasher: Hasher::new() };
        // The record is an object that is not empty, and goes on.
        results.write(&format!("{}{LEVELS}\n", head.strip_suffix('}').unwrap_or(&head)))?;
        Ok(results)
    }

    /// Adds a level, as a line of JSON without line feed.
    pub fn push(&mut self, line: &str) -> io::Result<()> {
        let separator = if self.is_first { "" } else { ",\n" };
        self.is_first = false;
        self.write(&format!("{separator}{line}"))
    }

    /// Ends the file.
    pub fn end(mut self) -> io::Result<()> {
        let line_feed = if self.is_first { "" } else { "\n" };
        self.write(line_feed)?;
        let end = end(&self.hasher);
        writeln!(self.out, "{end}")
    }

    fn write(&mut self, text: &str) -> io::Result<()> {
        self.hasher.update(text.as_bytes());
        self.out.write_all(text.as_bytes())
    }
}

/// The levels of a `results.json`, in their order, as lines of JSON.
pub struct ResultLines {
    path: PathBuf,
    record: TestRecord,
    lines: io::Lines<BufReader<File>>,
    /// Number of lines read so far.
    number: usize,
    is_over: bool,
    /// Checksum of the lines read so far.
    hasher: Hasher,
}

impl ResultLines {
    /// Opens the results in a folder.
    ///
    /// # Errors
    ///
    /// [`TestError::NoResults`] without results; [`TestError::Damaged`] if they differ from the form of
    /// [`TestFolder`](super::TestFolder).
    pub fn open(folder: &Path) -> Result<Self, TestError> {
        let path = folder.join(RESULTS);
        let file = File::open(&path).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => TestError::NoResults(folder.into()),
            _ => TestError::Io { action: "read", path: path.clone(), source },
        })?;
        let mut lines = BufReader::new(file).lines();
        let head = lines.next().transpose().map_err(io_error("read", &path))?.unwrap_or_default();
        let mut hasher = Hasher::new();
        hash_line(&mut hasher, &head);
        let record = head.strip_suffix(LEVELS).map(|record| serde_json::from_str(&format!("{record}}}")));
        let record = match record {
            Some(Ok(record)) => record,
            Some(Err(error)) => return Err(TestError::Damaged { path, line: 1, message: json_fault(&error) }),
            None => {
                let message = "this is not the head of results".to_owned();
                return Err(TestError::Damaged { path, line: 1, message });
            }
        };
        Ok(Self { path, record, lines, number: 1, is_over: false, hasher })
    }

    /// Opens the results as [`open`](Self::open) does, after a check of the checksum over the whole file.
    ///
    /// # Errors
    ///
    /// As for [`open`](Self::open); and the file is incomplete, or its checksum is wrong.
    pub fn open_whole(folder: &Path) -> Result<Self, TestError> {
        let mut lines = Self::open(folder)?;
        while lines.next_line()?.is_some() {}
        Self::open(folder)
    }

    /// Returns the description of the test.
    pub fn record(&self) -> &TestRecord {
        &self.record
    }

    /// Returns the line of the next level; `None` after the last one.
    ///
    /// # Errors
    ///
    /// The file is incomplete, or cannot be read.
    pub fn next_line(&mut self) -> Result<Option<String>, TestError> {
        if self.is_over {
            return Ok(None);
        }
        let line = self.lines.next().transpose().map_err(io_error("read", &self.path))?;
        self.number += 1;
        match line {
            // No level begins so.
            Some(line) if line.starts_with(']') => {
                if line != END && line != end(&self.hasher) {
                    return Err(self.damaged(&BrokenSeal.to_string()));
                }
                if self.lines.next().is_some() {
                    self.number += 1;
                    return Err(self.damaged("the file goes on after its end"));
                }
                self.is_over = true;
                Ok(None)
            }
            Some(line) => {
                hash_line(&mut self.hasher, &line);
                Ok(Some(line.strip_suffix(',').unwrap_or(&line).to_owned()))
            }
            None => Err(self.damaged("the file ends in the middle")),
        }
    }

    /// Returns the next level; `None` after the last one.
    ///
    /// # Errors
    ///
    /// The file is incomplete, is malformed, or cannot be read.
    pub fn next_level(&mut self) -> Result<Option<LevelVerdict>, TestError> {
        let Some(line) = self.next_line()? else { return Ok(None) };
        serde_json::from_str(&line).map(Some).map_err(|error| self.damaged(&json_fault(&error)))
    }

    /// Returns the line of the next level, which must have this index in the range.
    ///
    /// # Errors
    ///
    /// The next level is another one, or missing.
    pub(super) fn line_of(&mut self, index: u64) -> Result<String, TestError> {
        let line = self.next_line()?.ok_or_else(|| self.damaged("levels are missing"))?;
        let found = serde_json::from_str::<Value>(&line).map_err(|error| self.damaged(&json_fault(&error)))?;
        match found["index"].as_u64() {
            Some(found) if found == index => Ok(line),
            _ => Err(self.damaged(&format!("this is not the level with index {index}"))),
        }
    }

    /// Reads the end, which nothing may follow: the checksum there confirms the levels before it.
    ///
    /// # Errors
    ///
    /// Another level follows, or the checksum is wrong.
    pub(super) fn expect_end(&mut self) -> Result<(), TestError> {
        match self.next_line()? {
            None => Ok(()),
            Some(_) => Err(self.damaged("there are more levels than were tested")),
        }
    }

    fn damaged(&self, message: &str) -> TestError {
        TestError::Damaged { path: self.path.clone(), line: self.number, message: message.to_owned() }
    }
}

fn hash_line(hasher: &mut Hasher, line: &str) {
    hasher.update(line.as_bytes());
    hasher.update(b"\n");
}

#[cfg(test)]
mod tests;

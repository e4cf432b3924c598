//! The journal `levels.jsonl`: finished levels as they come in, each with a checksum.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs::{OpenOptions, TryLockError},
    io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use playbot_learner::{disk::DiskFile, seal_json};
use serde::Deserialize;

use super::{
    error::{JOURNAL, TestError, io_error},
    level_verdict::LevelVerdict,
};
use crate::sealed_file::unsealed_line;

/// A file with a line of JSON for each finished level, in the order of finishing. It is locked while open.
pub(super) struct Journal {
    path: PathBuf,
    file: DiskFile,
    /// Start and length in bytes of each level's line, without its line feed, by index in the range.
    lines: BTreeMap<u64, (u64, usize)>,
    length: u64,
}

/// Index of a level in the range.
#[derive(Deserialize)]
struct Place {
    index: u64,
}

impl Journal {
    /// Opens the journal of a folder with all whole lines, and makes a missing file. Cuts off everything from the
    /// first damaged line on, and returns the number of bytes cut.
    ///
    /// # Errors
    ///
    /// [`TestError::Busy`], or the operating system refuses.
    pub fn open(folder: &Path) -> Result<(Self, u64), TestError> {
        let path = folder.join(JOURNAL);
        let file = DiskFile::open(&path, OpenOptions::new().read(true).write(true).create(true).truncate(false));
        let mut file = file.map_err(io_error("open", &path))?;
        match file.as_file().try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(TestError::Busy(folder.into())),
            // Some network file systems have no locks.
            Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {
                tracing::warn!("{} cannot be locked: make sure that nothing else tests there", folder.display());
            }
            Err(TryLockError::Error(error)) => return Err(io_error("lock", &path)(error)),
        }
        let found = whole_lines(&mut file).and_then(|(lines, length)| {
            let cut = file.as_file().metadata()?.len() - length;
            file.set_len(length)?;
            file.seek(SeekFrom::Start(length))?;
            Ok((lines, length, cut))
        });
        let (lines, length, cut) = found.map_err(io_error("read", &path))?;
        Ok((Self { path, file, lines, length }, cut))
    }

    /// Removes all levels.
    ///
    /// # Errors
    ///
    /// The operating system refuses.
    pub fn clear(&mut self) -> Result<(), TestError> {
        self.lines.clear();
        self.length = 0;
        let emptied = self.file.set_len(0).and_then(|()| self.file.seek(SeekFrom::Start(0)));
        // Without a sync, a power cut could bring old levels into the new test.
        emptied.and_then(|_| self.file.sync()).map_err(io_error("empty", &self.path))
    }

    /// Returns the finished levels by their index in the range.
    pub fn places(&self) -> BTreeSet<u64> {
        self.lines.keys().copied().collect()
    }

    /// Adds a level with one write. If that fails, the levels before stay whole.
    ///
    /// # Errors
    ///
    /// [`TestError::NotKept`].
    pub fn push(&mut self, verdict: &LevelVerdict) -> Result<(), TestError> {
        let written = serde_json::to_string(verdict).map_err(io::Error::from).and_then(|line| {
            let line = seal_json(&line);
            self.file.write_all(format!("{line}\n").as_bytes())?;
            Ok(line.len())
        });
        match written {
            Ok(bytes) => {
                self.lines.insert(verdict.index, (self.length, bytes));
                self.length += bytes as u64 + 1;
                Ok(())
            }
            Err(source) => {
                // A partial line would be dropped at the next read anyway.
                let _ = self.file.set_len(self.length);
                Err(TestError::NotKept { path: self.path.clone(), finished: self.lines.len() as u64, source })
            }
        }
    }

    /// Passes the lines to `take` in the order of the levels, without their line feeds.
    ///
    /// # Errors
    ///
    /// `take` fails, or the file cannot be read.
    pub fn in_order(&mut self, mut take: impl FnMut(&str) -> io::Result<()>) -> io::Result<()> {
        for &(start, bytes) in self.lines.values() {
            let mut line = vec![0; bytes];
            self.file.seek(SeekFrom::Start(start))?;
            self.file.read_exact(&mut line)?;
            take(&unsealed_line(&line).ok_or(io::ErrorKind::InvalidData)?.text)?;
        }
        self.file.seek(SeekFrom::Start(self.length)).map(drop)
    }
}

/// Returns the positions of the lines before the first damaged one, and the start of that one. Of two lines of one
/// level the first counts.
fn whole_lines(file: &mut DiskFile) -> io::Result<(BTreeMap<u64, (u64, usize)>, u64)> {
    let (mut lines, mut length) = (BTreeMap::new(), 0);
    let mut reader = BufReader::new(file);
    let mut line = Vec::new();
    loop {
        line.clear();
        reader.read_until(b'\n', &mut line)?;
        let Some(text) = line.strip_suffix(b"\n") else { break };
        let Some(line_text) = unsealed_line(text).map(|line| line.text) else { break };
        let Ok(place) = serde_json::from_str::<Place>(&line_text) else { break };
        lines.entry(place.index).or_insert((length, text.len()));
        length += line.len() as u64;
    }
    Ok((lines, length))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::verdict::testing::verdict;

    fn lines(journal: &mut Journal) -> Vec<String> {
        let mut lines = Vec::new();
        let take = |line: &str| {
            lines.push(line.to_owned());
            Ok(())
        };
        journal.in_order(take).expect("readable");
        lines
    }

    #[test]
    fn levels_come_back_in_their_order_and_a_torn_line_is_cut() {
        let folder = tempfile::tempdir().expect("a folder");
        let (mut journal, _) = Journal::open(folder.path()).expect("new");
        for index in [2, 0, 1] {
            journal.push(&verdict(index, 1, 1)).expect("writable");
        }
        let levels: Vec<String> = lines(&mut journal);
        assert!(levels[0].contains("\"index\":0") && levels[2].contains("\"index\":2"), "{levels:?}");
        assert!(matches!(Journal::open(folder.path()), Err(TestError::Busy(_))));
        drop(journal);

        let path = folder.path().join(JOURNAL);
        let whole = fs::read(&path).expect("readable");
        fs::write(&path, [whole.as_slice(), b"{\"index\":3,\"lev"].concat()).expect("writable");
        let (mut journal, cut) = Journal::open(folder.path()).expect("it is there");
        assert_eq!((cut, journal.places()), (15, BTreeSet::from([0, 1, 2])));
        journal.push(&verdict(3, 0, 1)).expect("writable");
        assert_eq!(lines(&mut journal).len(), 4);
        assert_eq!(fs::read(&path).expect("readable")[..whole.len()], whole);
        journal.clear().expect("writable");
        assert_eq!((fs::read(&path).expect("readable").len(), journal.places().len()), (0, 0));
    }
}

//! The folder of a test.
//!
//! ```text
//! DIR/test.json      levels, testers and settings
//! DIR/levels.jsonl   finished levels as they come in
//! DIR/results.json   all of them in their order, once the test is done
//! ```

use crate::{
    findings::{FINDINGS, RecordedCourse, clear_findings, first_finding},
    verdict::{
        LevelVerdict,
        error::{JOURNAL, TestError, io_error},
        plan::{RECORD, TestRecord},
        results::{RESULTS, ResultWriter},
    },
};
use playbot_harness::sealed_file::{remove_temporaries, unsealed_line};
use playbot_learner::{disk, disk::DiskFile, seal_json, write_atomically, write_atomically_with};
use serde::Deserialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs::{OpenOptions, TryLockError},
    io,
    io::{BufRead, BufReader, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

/// Treatment of earlier results in the folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Earlier {
    /// Keep them: opening is an error.
    Keep,
    /// Continue them, if they are of the same test.
    Resume,
    /// Replace them.
    Replace,
}

/// An open folder of a test, locked for other processes.
pub struct TestFolder {
    path: PathBuf,
    record: TestRecord,
    journal: Journal,
}

impl TestFolder {
    /// Opens the folder for a test, and makes it if it is missing. Also returns a warning if something was damaged
    /// and is tested again.
    ///
    /// # Errors
    ///
    /// [`TestError::Exists`], [`TestError::OtherPlan`], [`TestError::Busy`]; or it cannot be written.
    pub fn open(path: &Path, record: &TestRecord, earlier: Earlier) -> Result<(Self, Option<String>), TestError> {
        if path.is_file() {
            return Err(TestError::NotAFolder(path.into()));
        }
        if let Some(finding) = first_finding(path) {
            return Err(TestError::HasFindings(finding));
        }
        disk::create_dir_all(path).map_err(io_error("create", path))?;
        let (record_file, results) = (path.join(RECORD), path.join(RESULTS));
        let is_known = record_file.exists();
        let is_taken = is_known || results.exists();
        match earlier {
            Earlier::Keep if is_taken => return Err(TestError::Exists(path.into())),
            // Results of another kind, such as joined ones.
            Earlier::Resume if is_taken && !is_known => return Err(TestError::Exists(path.into())),
            Earlier::Resume if is_known => check_same(path, &record_file, record)?,
            _ => {}
        }
        let (mut journal, cut) = Journal::open(path)?;
        remove_temporaries(path);
        remove_temporaries(&path.join(FINDINGS));
        let goes_on = is_known && earlier == Earlier::Resume;
        if !goes_on {
            // Old levels are meaningless without the description of their test.
            for file in [&record_file, &results] {
                remove(file)?;
            }
            clear_findings(path)?;
            journal.clear()?;
            let text = serde_json::to_string(record).map_err(io::Error::from);
            let written = text.and_then(|text| write_atomically(&record_file, seal_json(&text).as_bytes()));
            written.map_err(io_error("write", &record_file))?;
        }
        let message = (goes_on && cut > 0).then(|| {
            format!("{}: the last {cut} bytes are an incomplete level and were dropped", path.join(JOURNAL).display())
        });
        Ok((Self { path: path.into(), record: record.clone(), journal }, message))
    }

    /// Returns the finished levels by their index in the range.
    pub fn finished(&self) -> std::collections::BTreeSet<u64> {
        self.journal.places()
    }

    /// Adds a finished level, atomically.
    ///
    /// # Errors
    ///
    /// [`TestError::NotKept`].
    pub fn keep(&mut self, verdict: &LevelVerdict) -> Result<(), TestError> {
        self.journal.push(verdict)
    }

    /// Writes `results.json`, once all levels are finished.
    ///
    /// # Errors
    ///
    /// It cannot be written; the levels are still kept.
    pub fn finish(&mut self) -> Result<(), TestError> {
        self.finish_against(&BTreeMap::new())
    }

    /// Writes `results.json` as [`finish`](Self::finish) does, with the courses of recorded actions by the index of the
    /// level. The journal has none, so that `--resume` may compare with another recording.
    ///
    /// # Errors
    ///
    /// As for [`finish`](Self::finish).
    pub fn finish_against(&mut self, courses: &BTreeMap<u64, RecordedCourse>) -> Result<(), TestError> {
        let path = self.path.join(RESULTS);
        let written = write_atomically_with(&path, |file| {
            let mut results = ResultWriter::begin(file, &self.record)?;
            self.journal.in_order(|line| match courses.get(&serde_json::from_str::<LevelIndex>(line)?.index) {
                Some(course) => {
                    let course = serde_json::to_string(course)?;
                    // The level is an object that is not empty, and goes on.
                    results.push(&format!("{},\"recorded\":{course}}}", line.strip_suffix('}').unwrap_or(line)))
                }
                None => results.push(line),
            })?;
            results.end()
        });
        written.map_err(io_error("write", &path))
    }
}

fn remove(file: &Path) -> Result<(), TestError> {
    match disk::remove_file(file) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(io_error("remove", file)(error)),
        _ => Ok(()),
    }
}

fn check_same(folder: &Path, file: &Path, record: &TestRecord) -> Result<(), TestError> {
    let known = TestRecord::read(file)?;
    let mut differences = known.differences(record);
    if known.shard != record.shard {
        let words =
            |record: &TestRecord| record.shard.map_or("all levels".to_owned(), |shard| format!("shard {shard}"));
        differences.push(format!("{} and {}", words(&known), words(record)));
    }
    if differences.is_empty() { Ok(()) } else { Err(TestError::OtherPlan { folder: folder.into(), differences }) }
}

// Journal of finished levels.

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
struct LevelIndex {
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
        let Ok(place) = serde_json::from_str::<LevelIndex>(&line_text) else { break };
        lines.entry(place.index).or_insert((length, text.len()));
        length += line.len() as u64;
    }
    Ok((lines, length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::{results::ResultLines, testing, testing::verdict};
    use playbot_learner::HasExitCode as _;
    use std::fs;

    fn record() -> TestRecord {
        testing::record("hard:0..2")
    }

    #[test]
    fn a_test_that_was_killed_goes_on_and_another_one_is_refused() {
        let parent = tempfile::tempdir().expect("a folder");
        let path = parent.path().join("new/test");
        let open = |record: &TestRecord, earlier| TestFolder::open(&path, record, earlier);
        let (mut folder, _) = open(&record(), Earlier::Resume).expect("nothing is there yet");
        folder.keep(&verdict(1, 1, 1)).expect("writable");
        drop(folder);
        assert!(matches!(open(&record(), Earlier::Keep), Err(TestError::Exists(_))));
        let error = ResultLines::open(&path).map(drop).expect_err("it is not done").to_string();
        let resumed = "`playbot test garden --levels hard:0..2 --bot random --episodes 1 --seed 0 --out ";
        assert!(error.contains(&format!("finish it with {resumed}{} --resume`", path.display())), "{error}");
        let other = TestRecord { seed: 1, shard: Some("0/2".parse().expect("a shard")), ..record() };
        let error = open(&other, Earlier::Resume).map(drop).expect_err("another test").to_string();
        assert!(error.contains("which differs (there and here) in seeds 0 and 1, all levels and shard 0/2"), "{error}");
        let file = path.join(RECORD);
        let error = TestFolder::open(&file, &record(), Earlier::Replace).map(drop).expect_err("a file");
        assert!(error.is_usage() && error.to_string().contains("test.json is a file"), "{error}");
        let findings = path.join(FINDINGS);
        fs::create_dir_all(&findings).expect("writable");
        fs::write(findings.join("a.finding"), "").expect("writable");
        let error = TestFolder::open(&findings, &record(), Earlier::Replace).map(drop).expect_err("another test's");
        assert!(error.is_usage() && error.to_string().contains("a.finding is a finding"), "{error}");

        let journal = path.join(JOURNAL);
        let torn = [fs::read(&journal).expect("written"), b"{\"ind".to_vec()].concat();
        fs::write(&journal, torn).expect("writable");
        let (mut folder, message) = open(&record(), Earlier::Resume).expect("the same test");
        assert!(message.is_some_and(|message| message.contains("last 5 bytes")));
        assert_eq!(folder.finished().into_iter().collect::<Vec<_>>(), [1]);
        for index in [2, 0] {
            folder.keep(&verdict(index, 0, 1)).expect("writable");
        }
        folder.finish().expect("writable");
        let mut lines = ResultLines::open(&path).expect("results");
        for index in 0..3 {
            assert_eq!(lines.next_level().expect("whole").map(|level| level.index), Some(index));
        }
        assert!(lines.next_level().expect("whole").is_none());
        drop(folder);

        let (folder, _) = open(&other, Earlier::Replace).expect("it may go");
        assert!(folder.finished().is_empty() && !path.join(RESULTS).exists());
    }

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

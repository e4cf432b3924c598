//! The folder of a test.
//!
//! ```text
//! DIR/test.json      levels, testers and settings
//! DIR/levels.jsonl   finished levels as they come in
//! DIR/results.json   all of them in their order, once the test is done
//! ```

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use playbot_learner::{disk, seal_json, unseal_json, write_atomically, write_atomically_with};

use super::{
    error::{JOURNAL, TestError, io_error, json_fault},
    journal::Journal,
    level_verdict::LevelVerdict,
    plan::TestRecord,
    results::{RESULTS, ResultWriter},
};
use crate::{
    findings::{FINDINGS, clear_findings},
    sealed_file::remove_temporaries,
};

/// Name of the file with the description of the test.
const RECORD: &str = "test.json";

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
        let path = self.path.join(RESULTS);
        let written = write_atomically_with(&path, |file| {
            let mut results = ResultWriter::begin(file, &self.record)?;
            self.journal.in_order(|line| results.push(line))?;
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
    let text = fs::read_to_string(file).map_err(io_error("read", file))?;
    let damaged = |line, message| TestError::Damaged { path: file.into(), line, message };
    let text = unseal_json(&text).map_err(|error| damaged(1, error.to_string()))?.text;
    let known: TestRecord = serde_json::from_str(&text).map_err(|error| damaged(error.line(), json_fault(&error)))?;
    let mut differences = known.differences(record);
    if known.shard != record.shard {
        let words =
            |record: &TestRecord| record.shard.map_or("all levels".to_owned(), |shard| format!("shard {shard}"));
        differences.push(format!("{} and {}", words(&known), words(record)));
    }
    if differences.is_empty() { Ok(()) } else { Err(TestError::OtherPlan { folder: folder.into(), differences }) }
}

#[cfg(test)]
mod tests {
    use playbot_learner::HasExitCode as _;

    use super::*;
    use crate::verdict::{MapScope, TesterRecord, results::ResultLines, testing::verdict};

    fn record() -> TestRecord {
        TestRecord {
            game: "garden".to_owned(),
            game_version: 1,
            range: "hard:0..2".parse().expect("a split"),
            files: None,
            seed: 0,
            testers: vec![TesterRecord::bot("random")],
            episodes: 1,
            detectors: Vec::new(),
            options: Vec::new(),
            maps: MapScope::default(),
            shard: None,
        }
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
        let other = TestRecord { seed: 1, shard: Some("0/2".parse().expect("a shard")), ..record() };
        let error = open(&other, Earlier::Resume).map(drop).expect_err("another test").to_string();
        assert!(error.contains("which differs (there and here) in seeds 0 and 1, all levels and shard 0/2"), "{error}");
        let file = path.join(RECORD);
        let error = TestFolder::open(&file, &record(), Earlier::Replace).map(drop).expect_err("a file");
        assert!(error.is_usage() && error.to_string().contains("test.json is a file"), "{error}");

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
}

//! The journal of finished jobs, beside the file of their score.

use crate::score::{
    JobResult,
    error::{ScoreError, io_error},
    record::ScoreRecord,
};
use playbot_harness::sealed_file::unsealed_line;
use playbot_learner::{Unsealed, disk, disk::DiskFile, seal_json};
use playbot_test::verdict::Earlier;
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    fs::{OpenOptions, TryLockError},
    io,
    io::{BufRead, BufReader, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

/// The first line.
#[derive(Serialize, Deserialize)]
struct Head {
    command: String,
    #[serde(flatten)]
    record: ScoreRecord,
}

/// A file with a line of JSON for each finished job. It is locked while it is open for writing.
pub struct ScoreJournal {
    path: PathBuf,
    file: DiskFile,
    length: u64,
    command: String,
    finished: BTreeMap<(String, String), JobResult>,
}

impl ScoreJournal {
    /// Opens the journal of a score file that is not written yet, with all of its finished jobs. `command` is the
    /// command that makes the score; that of the first call is kept. Also returns how many damaged bytes were cut off.
    ///
    /// # Errors
    ///
    /// The score exists already, another process makes it, the journal belongs to another score, or the system cannot
    /// read or write it.
    pub fn open(
        score: &Path,
        command: &str,
        record: &ScoreRecord,
        earlier: Earlier,
    ) -> Result<(Self, u64), ScoreError> {
        let path = journal_of(score);
        if earlier == Earlier::Keep && (score.exists() || path.exists()) {
            return Err(ScoreError::Exists(score.into()));
        }
        let file = DiskFile::open(&path, OpenOptions::new().read(true).write(true).create(true).truncate(false));
        let file = file.map_err(io_error("open", &path))?;
        match file.as_file().try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(ScoreError::Busy(score.into())),
            // Some network file systems have no locks.
            Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(io_error("lock", &path)(error)),
        }
        if earlier == Earlier::Replace {
            file.set_len(0).map_err(io_error("empty", &path))?;
        }
        let mut journal = Self { path, file, length: 0, command: command.to_owned(), finished: BTreeMap::new() };
        let cut = journal.read(score, record)?;
        if journal.length == 0 {
            journal.write(&Head { command: command.to_owned(), record: record.clone() })?;
        }
        Ok((journal, cut))
    }

    /// Returns whether the journal has jobs of an unfinished score.
    pub fn is_begun(score: &Path) -> bool {
        journal_of(score).exists()
    }

    /// Returns the finished jobs, by subject and tester.
    pub fn finished(&self) -> &BTreeMap<(String, String), JobResult> {
        &self.finished
    }

    /// Returns the command that makes the score.
    pub fn command(&self) -> &str {
        &self.command
    }

    /// Adds a job with one write. If that fails, earlier jobs stay intact.
    ///
    /// # Errors
    ///
    /// The system cannot write.
    pub fn push(&mut self, result: JobResult) -> Result<(), ScoreError> {
        self.write(&result)?;
        self.finished.insert((result.subject.clone(), result.tester.clone()), result);
        Ok(())
    }

    /// Removes the file, after the score is written.
    ///
    /// # Errors
    ///
    /// The system cannot remove it.
    pub fn close(self) -> Result<(), ScoreError> {
        let Self { path, file, .. } = self;
        // Some systems cannot remove open files.
        drop(file);
        disk::remove_file(&path).map_err(io_error("remove", &path))
    }

    fn write(&mut self, line: &impl Serialize) -> Result<(), ScoreError> {
        let written = serde_json::to_string(line).map_err(io::Error::from).and_then(|line| {
            let line = seal_json(&line);
            self.file.write_all(format!("{line}\n").as_bytes())?;
            Ok(line.len() as u64 + 1)
        });
        match written {
            Ok(bytes) => {
                self.length += bytes;
                Ok(())
            }
            Err(source) => {
                // Half a line would be dropped anyway when the file is read again.
                let _ = self.file.set_len(self.length);
                Err(io_error("write", &self.path)(source))
            }
        }
    }

    /// Reads all intact lines, and cuts off the rest from the first damaged one.
    fn read(&mut self, score: &Path, record: &ScoreRecord) -> Result<u64, ScoreError> {
        let mut reader = BufReader::new(self.file.as_file());
        let mut line = Vec::new();
        loop {
            line.clear();
            reader.read_until(b'\n', &mut line).map_err(io_error("read", &self.path))?;
            let Some(Unsealed { text, .. }) = line.strip_suffix(b"\n").and_then(unsealed_line) else { break };
            if self.length == 0 {
                let Ok(head) = serde_json::from_str::<Head>(&text) else { break };
                let differences = head.record.differences(record);
                if !differences.is_empty() {
                    return Err(ScoreError::OtherScore { path: score.into(), differences });
                }
                self.command = head.command;
            } else {
                let Ok(result) = serde_json::from_str::<JobResult>(&text) else { break };
                self.finished.insert((result.subject.clone(), result.tester.clone()), result);
            }
            self.length += line.len() as u64;
        }
        drop(reader);
        let whole = self.length;
        let cut = self.file.as_file().metadata().map_err(io_error("read", &self.path))?.len().saturating_sub(whole);
        let cut_off = self.file.set_len(whole).and_then(|()| self.file.seek(SeekFrom::Start(whole)));
        cut_off.map_err(io_error("read", &self.path))?;
        Ok(cut)
    }
}

/// Returns the journal's path: `score.json` has `score.json.jobs`.
fn journal_of(score: &Path) -> PathBuf {
    let mut name = score.file_name().unwrap_or_default().to_owned();
    name.push(".jobs");
    score.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::score::testing::record;

    fn result(subject: &str) -> JobResult {
        JobResult { subject: subject.to_owned(), tester: "random".to_owned(), ..JobResult::default() }
    }

    #[test]
    fn finished_jobs_come_back_and_a_torn_line_is_cut() {
        let folder = tempfile::tempdir().expect("a folder");
        let score = folder.path().join("score.json");
        let record = record("garden", &["random"]);
        let open = |earlier| ScoreJournal::open(&score, "the command", &record, earlier);
        let (mut journal, _) = open(Earlier::Keep).expect("new");
        journal.push(result("a")).expect("writable");
        assert!(matches!(open(Earlier::Resume), Err(ScoreError::Busy(_))));
        drop(journal);
        assert!(matches!(open(Earlier::Keep), Err(ScoreError::Exists(_))));

        let path = journal_of(&score);
        let whole = fs::read(&path).expect("readable");
        fs::write(&path, [whole.as_slice(), b"{\"subject\":\"b\",\"tes"].concat()).expect("writable");
        let (mut journal, cut) = ScoreJournal::open(&score, "another", &record, Earlier::Resume).expect("it is there");
        assert_eq!((cut, journal.finished().len(), journal.command()), (19, 1, "the command"));
        journal.push(result("b")).expect("writable");
        drop(journal);
        let (journal, cut) = open(Earlier::Resume).expect("whole");
        assert_eq!((cut, journal.finished().len()), (0, 2));
        drop(journal);
        let (journal, _) = open(Earlier::Replace).expect("anew");
        assert!(journal.finished().is_empty());
        journal.close().expect("removable");
        assert!(!path.exists());
    }

    #[test]
    fn another_score_is_not_gone_on_with() {
        let folder = tempfile::tempdir().expect("a folder");
        let score = folder.path().join("score.json");
        let open = |testers: &[&str]| ScoreJournal::open(&score, "", &record("garden", testers), Earlier::Resume);
        drop(open(&["random"]).expect("new"));
        let words = open(&["chaos"]).map(drop).expect_err("other testers").to_string();
        assert!(words.contains("garden 1 by random under") && words.contains("by chaos under"), "{words}");
    }
}

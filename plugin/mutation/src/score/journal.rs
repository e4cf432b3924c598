//! The journal of finished jobs, beside the file of their score.

use crate::score::{
    JobResult,
    error::{ScoreError, io_error},
    found::ScoredJob,
    record::{SCORE_FORMAT, ScoreRecord, Subject},
};
use playbot_harness::sealed_file::unsealed_line;
use playbot_learner::{Unsealed, disk, disk::DiskFile, seal_json, unseal_json, write_atomically};
use playbot_test::verdict::Earlier;
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    fs,
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

// Files of scores.

/// The results of testers on a set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// The set, the testers and the settings.
    #[serde(flatten)]
    pub record: ScoreRecord,
    /// The command that made it.
    pub command: String,
    /// The mutants and unmutated levels.
    pub subjects: Vec<Subject>,
    /// The results, in the order of the subjects and, for each, of the testers.
    pub jobs: Vec<ScoredJob>,
}

/// The part of the file that is read before its form is known.
#[derive(Deserialize)]
struct FormOnly {
    format: u32,
}

impl Score {
    /// Writes the file atomically, with a line for each subject and each job.
    ///
    /// # Errors
    ///
    /// The system cannot write.
    pub fn write(&self, path: &Path) -> Result<(), ScoreError> {
        let written = self.text().and_then(|text| write_atomically(path, seal_json(&text).as_bytes()));
        written.map_err(io_error("write", path))
    }

    fn text(&self) -> io::Result<String> {
        let head = serde_json::to_string(&self.record)?;
        let head = head.strip_suffix('}').unwrap_or(&head);
        let (subjects, jobs) = (lines(&self.subjects)?, lines(&self.jobs)?);
        let command = serde_json::to_string(&self.command)?;
        Ok(format!("{head},\"command\":{command},\n\"subjects\":[{subjects}],\n\"jobs\":[{jobs}]}}\n"))
    }

    /// Reads a file.
    ///
    /// # Errors
    ///
    /// The file is not a score, has a form that this program does not know, or cannot be read.
    pub fn read(path: &Path) -> Result<Self, ScoreError> {
        let text = fs::read_to_string(path).map_err(io_error("read", path))?;
        let no_score = |why: String| ScoreError::NoScore { path: path.into(), why };
        let of_json = |error: serde_json::Error| no_score(format!("line {}: {error}", error.line()));
        let text = unseal_json(&text).map_err(|error| no_score(error.to_string()))?.text;
        let FormOnly { format } = serde_json::from_str(&text).map_err(of_json)?;
        if format != SCORE_FORMAT {
            return Err(no_score(format!("a score in form {format}, but this program reads form {SCORE_FORMAT}")));
        }
        serde_json::from_str(&text).map_err(of_json)
    }
}

/// Returns the JSON of some items, a line each.
fn lines(items: &[impl Serialize]) -> serde_json::Result<String> {
    let mut text = String::new();
    for (index, item) in items.iter().enumerate() {
        text.push_str(if index == 0 { "\n" } else { ",\n" });
        text.push_str(&serde_json::to_string(item)?);
    }
    Ok(text)
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

#[cfg(test)]
mod file_tests {
    use super::*;
    use crate::score::testing::{job, mutant, record};

    #[test]
    fn a_score_is_written_in_lines_and_reads_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("score.json");
        let score = Score {
            record: record("garden", &["random"]),
            command: "playbot bugs score set --out \"a b.json\"".to_owned(),
            subjects: vec![mutant("garden", "a", "panic"), mutant("garden", "b", "panic")],
            jobs: vec![job("a", "random", true), job("b", "random", false)],
        };
        score.write(&path).expect("writable");
        assert_eq!(Score::read(&path).expect("readable"), score);
        assert_eq!(fs::read_to_string(&path).expect("readable").lines().count(), 7);
        let empty = Score { subjects: Vec::new(), jobs: Vec::new(), ..score };
        empty.write(&path).expect("writable");
        assert_eq!(Score::read(&path).expect("readable"), empty);
    }

    #[test]
    fn what_is_no_score_is_refused_with_what_is_wrong() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("score.json");
        let said = |text: &str| {
            fs::write(&path, text).expect("writable");
            Score::read(&path).expect_err("no score").to_string()
        };
        let none = Score::read(&folder.path().join("none.json")).expect_err("no file").to_string();
        assert!(none.contains("none.json") && none.contains("name an existing file"), "{none}");
        assert!(said("{").contains("score.json: line 1: "));
        assert!(said("{\"format\":1}").contains("missing field"));
        assert!(said("{\"format\":9}").contains("a score in form 9, but this program reads form 1"));
    }
}

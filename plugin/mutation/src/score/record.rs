//! The record of a score, which is set, games, testers and settings, and the journal of its finished jobs.
//!
//! The journal lies beside the file of the score.

use crate::score::{
    JobResult,
    contestant::{ClockKind, ContestantRecord},
    error::{ScoreError, io_error},
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

// The record.

/// Newest form of score files that is read and written.
pub const SCORE_FORMAT: u32 = 1;

/// Everything that the results of a score depend on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScoreRecord {
    /// Form of the file.
    pub format: u32,
    /// The set.
    pub set: SetRecord,
    /// The games of the set that were tested.
    pub games: Vec<GameRecord>,
    /// The budget.
    pub budget: ScoreBudget,
    /// The clock.
    pub clock: ClockKind,
}

/// A set of mutants.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetRecord {
    /// Random seed of the set.
    pub seed: u64,
    /// Hash of the set.
    pub hash: String,
}

/// A game, and its testers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GameRecord {
    /// Name of the game.
    pub name: String,
    /// Version of its rules.
    pub version: u32,
    /// The testers.
    pub testers: Vec<ContestantRecord>,
    /// The detectors, each with its settings.
    pub detectors: Vec<String>,
    /// Names of the detectors that the game itself adds.
    #[serde(default)]
    pub own_detectors: Vec<String>,
}

/// The budget of each tester on each subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScoreBudget {
    /// Episodes of a tester that plays.
    pub episodes: u32,
    /// Environment steps of an explorer.
    pub steps: u64,
    /// Paths of an explorer that are replayed.
    pub routes: u32,
    /// Replays to minimise a finding; 0 for no minimisation.
    pub replays: u32,
    /// Random seed.
    pub seed: u64,
}

impl Default for ScoreBudget {
    fn default() -> Self {
        Self { episodes: 5, steps: 50_000, routes: 8, replays: 100, seed: 0 }
    }
}

impl ScoreRecord {
    /// Returns the differences between two scores, each in words.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let mut found = self.differences_of_way(other);
        if self.set != other.set {
            let words = |set: &SetRecord| format!("{} of seed {}", set.hash, set.seed);
            found.push(format!("sets {} and {}", words(&self.set), words(&other.set)));
        }
        if self.games != other.games {
            found.push(format!("games and testers {} and {}", self.describe_games(), other.describe_games()));
        }
        found
    }

    /// Returns the differences in settings. Scores of other games and sets can still be joined.
    pub fn differences_of_way(&self, other: &Self) -> Vec<String> {
        let mut found = Vec::new();
        let mut compare = |what: &str, one: String, other: String| {
            if one != other {
                found.push(format!("{what} {one} and {other}"));
            }
        };
        let (one, another) = (self.budget, other.budget);
        compare("forms", self.format.to_string(), other.format.to_string());
        compare("episodes", one.episodes.to_string(), another.episodes.to_string());
        compare("steps", one.steps.to_string(), another.steps.to_string());
        compare("routes", one.routes.to_string(), another.routes.to_string());
        compare("replays", one.replays.to_string(), another.replays.to_string());
        compare("seeds", one.seed.to_string(), another.seed.to_string());
        compare("clocks", self.clock.describe().to_owned(), other.clock.describe().to_owned());
        found
    }

    fn describe_games(&self) -> String {
        let tester = |tester: &ContestantRecord| {
            let sum = tester.checksum.as_ref().map_or_else(String::new, |sum| format!(" (file {sum})"));
            format!("{}{sum}{}", tester.name, if tester.greedy { " greedy" } else { "" })
        };
        let game = |game: &GameRecord| {
            let testers: Vec<String> = game.testers.iter().map(tester).collect();
            let (name, version) = (&game.name, game.version);
            format!("{name} {version} by {} under {}", testers.join(" + "), game.detectors.join(" + "))
        };
        self.games.iter().map(game).collect::<Vec<_>>().join("; ")
    }
}

/// A level of a game, unmutated or with a planted defect.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Subject {
    /// Its unique name: that of the mutant, or game and level, such as `GAME MODE:7`.
    pub id: String,
    /// Name of the game.
    pub game: String,
    /// Its kind.
    #[serde(flatten)]
    pub kind: SubjectKind,
}

/// The kind of a subject.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum SubjectKind {
    /// A subject with a planted defect.
    Mutant {
        /// Class of the defect.
        class: String,
        /// Name of the subject that it was made of.
        original: String,
    },
    /// An unmutated level: every finding in it is false.
    Sound,
    /// An unmutated level that mutants were made of, and that is not among those that are counted.
    Original,
}

impl Subject {
    /// Returns the class of its defect, if it has one.
    pub fn class(&self) -> Option<&str> {
        match &self.kind {
            SubjectKind::Mutant { class, .. } => Some(class),
            SubjectKind::Sound | SubjectKind::Original => None,
        }
    }

    /// Returns the name of an unmutated level.
    pub fn id_of_level(game: &str, mode: &str, level: u64) -> String {
        format!("{game} {mode}:{level}")
    }
}

// The journal of finished jobs.

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
    use super::*;
    use crate::score::testing::record;
    use std::fs;

    #[test]
    fn what_differs_is_named_and_other_games_can_be_joined() {
        let one = record("garden", &["random"]);
        assert!(one.differences(&one).is_empty());
        let other = record("forest", &["random", "chaos"]);
        let words = one.differences(&other);
        assert!(
            words[0].contains("garden 1 by random") && words[0].contains("forest 1 by random + chaos"),
            "{words:?}"
        );
        assert!(one.differences_of_way(&other).is_empty());
        let budget = ScoreBudget { steps: 7, ..one.budget };
        assert_eq!(one.differences_of_way(&ScoreRecord { budget, ..one.clone() }), ["steps 50000 and 7"]);
    }

    #[test]
    fn files_say_what_it_is() {
        let kind = SubjectKind::Mutant { class: "panic".to_owned(), original: "garden bed:3".to_owned() };
        let subject = Subject { id: "garden-panic-01".to_owned(), game: "garden".to_owned(), kind };
        let text = serde_json::to_string(&subject).expect("serialises");
        let expected =
            r#"{"id":"garden-panic-01","game":"garden","kind":"mutant","class":"panic","original":"garden bed:3"}"#;
        assert_eq!(text, expected);
        assert_eq!(serde_json::from_str::<Subject>(&text).expect("reads back"), subject);
        assert_eq!(subject.class(), Some("panic"));
    }

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

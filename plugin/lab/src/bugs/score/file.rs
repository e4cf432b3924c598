//! Files of scores.

use std::{fs, io, path::Path};

use playbot_learner::{seal_json, unseal_json, write_atomically};
use serde::{Deserialize, Serialize};

use super::{
    error::{ScoreError, io_error},
    found::ScoredJob,
    record::{SCORE_FORMAT, ScoreRecord},
    subject::Subject,
};

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
    use super::*;
    use crate::bugs::score::testing::{job, mutant, record};

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

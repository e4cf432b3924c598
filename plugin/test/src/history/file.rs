//! The file of a history: a line that names its form, and a line for each build, with its checksum in front.

use crate::history::{Build, History};
use playbot_learner::{HasExitCode, disk::DiskFile};
use serde_json::json;
use std::{
    fs::OpenOptions,
    io,
    io::Write,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// The form of the file.
const FORM: u64 = 1;

/// Failure to read or to add to a history.
#[derive(Debug, Error)]
pub enum HistoryError {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// The failed action.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The answer.
        source: io::Error,
    },
    /// It is no history.
    #[error("{} is no history: name a file that `playbot test --history` has written, or folders of results", .0.display())]
    NoHistory(PathBuf),
    /// It is of a later version.
    #[error("{} has form {form} of a history, and this program reads up to {FORM}: use a newer playbot", path.display())]
    Newer {
        /// The file.
        path: PathBuf,
        /// Its form.
        form: u64,
    },
    /// It is of another game.
    #[error("{} is the history of `{there}`, not of `{here}`: name another file", path.display())]
    OtherGame {
        /// The file.
        path: PathBuf,
        /// The game in it.
        there: String,
        /// The game to add.
        here: String,
    },
    /// Builds of two games.
    #[error(
        "{} has results of `{}`, and {} of `{}`: name results of one game", one.1, one.0, other.1, other.0
    )]
    TwoGames {
        /// One game, and a build of it.
        one: (String, String),
        /// The other one.
        other: (String, String),
    },
}

/// Checks that all builds are of one game.
///
/// # Errors
///
/// Two of them are of different games.
pub fn check_one_game(history: &History) -> Result<(), HistoryError> {
    let Some(first) = history.builds.first() else { return Ok(()) };
    match history.builds.iter().find(|build| build.game != first.game) {
        Some(other) => {
            let [one, other] = [first, other].map(|build| (build.game.clone(), build.build.clone()));
            Err(HistoryError::TwoGames { one, other })
        }
        None => Ok(()),
    }
}

impl HasExitCode for HistoryError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Io { .. } => 2,
            Self::NoHistory(_) | Self::Newer { .. } | Self::OtherGame { .. } | Self::TwoGames { .. } => 3,
        }
    }
}

fn refused(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> HistoryError {
    move |source| HistoryError::Io { action, path: path.into(), source }
}

/// Reads a history. Lines that are damaged are left out, and their numbers returned.
///
/// # Errors
///
/// The file cannot be read, is no history, or is of a later version.
pub fn read(path: &Path) -> Result<(History, Vec<usize>), HistoryError> {
    of_bytes(path, &std::fs::read(path).map_err(refused("read", path))?)
}

fn of_bytes(path: &Path, bytes: &[u8]) -> Result<(History, Vec<usize>), HistoryError> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text.lines();
    let head = lines.next().and_then(|line| serde_json::from_str::<serde_json::Value>(line).ok());
    let form = head.as_ref().and_then(|head| head["playbot_history"].as_u64());
    let form = form.ok_or_else(|| HistoryError::NoHistory(path.into()))?;
    if form > FORM {
        return Err(HistoryError::Newer { path: path.into(), form });
    }
    let (mut history, mut damaged) = (History::default(), Vec::new());
    for (number, line) in (2..).zip(lines) {
        match build_of(line) {
            Some(build) => history.builds.push(build),
            None => damaged.push(number),
        }
    }
    Ok((history, damaged))
}

fn build_of(line: &str) -> Option<Build> {
    let (sum, text) = line.split_once(' ')?;
    (sum == checksum(text)).then(|| serde_json::from_str(text).ok()).flatten()
}

fn checksum(text: &str) -> String {
    format!("{:08x}", crc32fast::hash(text.as_bytes()))
}

/// Checks that the history in a file is that of a game.
///
/// # Errors
///
/// It is of another one.
pub fn check_game(path: &Path, history: &History, game: &str) -> Result<(), HistoryError> {
    match history.builds.iter().find(|build| build.game != game) {
        Some(other) => {
            let (there, here) = (other.game.clone(), game.to_owned());
            Err(HistoryError::OtherGame { path: path.into(), there, here })
        }
        None => Ok(()),
    }
}

/// Adds a build to a history, which begins with it if there is no file. A line that was torn stays as it is.
///
/// # Errors
///
/// The file cannot be written, or is the history of something else.
pub fn add(path: &Path, build: &Build) -> Result<(), HistoryError> {
    let mut text = match std::fs::read(path) {
        Ok(bytes) => {
            check_game(path, &of_bytes(path, &bytes)?.0, &build.game)?;
            if bytes.ends_with(b"\n") { String::new() } else { "\n".to_owned() }
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => format!("{}\n", json!({ "playbot_history": FORM })),
        Err(error) => return Err(refused("read", path)(error)),
    };
    let line = json!(build).to_string();
    text += &format!("{} {line}\n", checksum(&line));
    let append = || DiskFile::open(path, OpenOptions::new().create(true).append(true))?.write_all(text.as_bytes());
    append().map_err(refused("write", path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::tests::thirty_builds;
    use std::fs;

    #[test]
    fn a_history_reads_back_and_a_damaged_line_costs_one_build() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("history.jsonl");
        let (history, ..) = thirty_builds();
        for build in &history.builds[..4] {
            add(&path, build).expect("writable");
        }
        assert_eq!(read(&path).expect("whole"), (History { builds: history.builds[..4].to_vec() }, Vec::new()));
        let text = fs::read_to_string(&path).expect("written");
        fs::write(&path, text.replacen("stuck", "st_ck", 1)).expect("writable");
        let (three, damaged) = read(&path).expect("a history");
        assert_eq!((three.builds.len(), damaged), (3, vec![2]));
        // Torn by a power cut: the next build begins a line of its own.
        fs::write(&path, &text[..text.len() - 9]).expect("writable");
        add(&path, &history.builds[9]).expect("writable");
        let (torn, damaged) = read(&path).expect("a history");
        assert_eq!(
            (torn.builds.len(), torn.builds[3].build.as_str(), damaged),
            (4, history.builds[9].build.as_str(), vec![5])
        );
    }

    #[test]
    fn what_is_no_history_of_this_game_and_version_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("history.jsonl");
        let (history, ..) = thirty_builds();
        fs::write(&path, "{}\n").expect("writable");
        assert!(matches!(read(&path), Err(HistoryError::NoHistory(_))));
        assert!(matches!(add(&path, &history.builds[0]), Err(HistoryError::NoHistory(_))), "it is not overwritten");
        fs::write(&path, "{\"playbot_history\":7}\n").expect("writable");
        let error = read(&path).expect_err("newer").to_string();
        assert!(error.contains("has form 7 of a history") && error.contains("use a newer playbot"), "{error}");
        fs::remove_file(&path).expect("it is there");
        add(&path, &history.builds[0]).expect("writable");
        let other = Build { game: "maze".to_owned(), ..history.builds[0].clone() };
        let error = add(&path, &other).expect_err("another game").to_string();
        assert!(error.contains("is the history of `garden`, not of `maze`"), "{error}");
        let mut both = history;
        both.builds[7] = other;
        let error = check_one_game(&both).expect_err("two games").to_string();
        assert_eq!(error, "b00 has results of `garden`, and b00 of `maze`: name results of one game");
        assert!(matches!(read(folder.path()), Err(HistoryError::Io { .. })));
    }
}

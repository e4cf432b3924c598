//! Errors of comparing results with recordings.

use std::path::PathBuf;

use bevy_playbot::demo::file::DemoFileError;
use thiserror::Error;

use crate::{level_files::LevelFileError, verdict::TestError};

/// The reason why results cannot be compared with recordings.
#[derive(Debug, Error)]
pub enum CalibrationError {
    /// The results cannot be read.
    #[error(transparent)]
    Results(#[from] TestError),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] DemoFileError),
    /// The level files of the results cannot be read.
    #[error(transparent)]
    Files(#[from] LevelFileError),
    /// A recording is of another game.
    #[error(
        "{}: a recording of the game `{found}`, but {} are results of `{game}`: name recordings of `{game}`",
        path.display(), results.display()
    )]
    OtherGame {
        /// The recording.
        path: PathBuf,
        /// Its game.
        found: String,
        /// The folder of the results.
        results: PathBuf,
        /// Their game.
        game: String,
    },
    /// A recording is of another version of the game.
    #[error(
        "{}: recorded with version {found} of `{game}`, but {} were tested with version {version}: people and bots had other \
         rules; record people again, or test with that version", path.display(), results.display()
    )]
    OtherVersion {
        /// The recording.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// The folder of the results.
        results: PathBuf,
        /// Their version.
        version: u32,
        /// The game.
        game: String,
    },
    /// The levels of the results are files, and only the game can compute their hashes.
    #[error(
        "the levels of {} are files, which the program of `{game}` must read to know them in recordings: use that program",
        results.display()
    )]
    NoGame {
        /// The folder of the results.
        results: PathBuf,
        /// Their game.
        game: String,
    },
    /// The files contain other levels than the tested ones.
    #[error(
        "the level files of {} ({range}) changed since the test: bring them back, run this in the folder in which they were \
         tested, or test them again", results.display()
    )]
    ChangedFiles {
        /// The folder of the results.
        results: PathBuf,
        /// The levels.
        range: String,
    },
    /// No person played an episode to its end.
    #[error(
        "no episode of {files} was played by a person to its end{}: record people with `playbot play GAME --record people.demo`",
        why(left_out)
    )]
    Nobody {
        /// The recordings.
        files: String,
        /// Counts of the episodes that do not count, each in words.
        left_out: Vec<String>,
    },
    /// People and testers played different levels.
    #[error(
        "no level is in both: people played {recorded}, and {} have {tested}: test the levels that people played, or record \
         people on these", results.display()
    )]
    NoSharedLevel {
        /// Levels of the recordings.
        recorded: String,
        /// The folder of the results.
        results: PathBuf,
        /// Their levels.
        tested: String,
    },
}

fn why(left_out: &[String]) -> String {
    if left_out.is_empty() { String::new() } else { format!(" ({})", left_out.join(", ")) }
}

//! Why results and recordings say nothing of each other.

use std::path::PathBuf;

use bevy_playbot::demo::file::DemoFileError;
use thiserror::Error;

use crate::{level_files::LevelFileError, verdict::TestError};

/// Results cannot be held beside recordings.
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
    /// Level files are known by hashes that the game makes.
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
    /// The files hold other levels by now.
    #[error(
        "the level files of {} ({range}) are not those that were tested: bring them back, call from the folder in which they \
         were tested, or test them again", results.display()
    )]
    ChangedFiles {
        /// The folder of the results.
        results: PathBuf,
        /// The levels.
        range: String,
    },
    /// Nobody played.
    #[error(
        "no episode of {files} was played by a person to its end{}: record people with `playbot play GAME --record people.demo`",
        why(left_out)
    )]
    Nobody {
        /// The recordings.
        files: String,
        /// What was left out, each in words.
        left_out: Vec<String>,
    },
    /// People and bots played other levels.
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

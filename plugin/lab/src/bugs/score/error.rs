//! What can go wrong when testers are scored.

use std::{
    io,
    path::{Path, PathBuf},
};

use bevy_playbot::vision::VisionError;
use thiserror::Error;

use crate::{bugs::BugError, explore::ExploreError, mode::ModeError, verdict::TestError};

/// Testers cannot be scored, or scores cannot be used.
#[derive(Debug, Error)]
pub enum ScoreError {
    /// The set has nothing for the games that were named.
    #[error(
        "the set has no mutant of {0}: name the folder of another set, or score with the program that has its games"
    )]
    NoMutant(String),
    /// Nobody would test.
    #[error("nobody tests `{0}`: name a tester that it has")]
    NoTester(String),
    /// Two testers of a game cannot be told apart.
    #[error("two testers of `{game}` are called `{tester}`: give each a name of its own")]
    SameName {
        /// The game.
        game: String,
        /// The name.
        tester: String,
    },
    /// The set cannot be used.
    #[error(transparent)]
    Set(#[from] BugError),
    /// A level cannot be played, and that is no finding.
    #[error("{subject} cannot be played: {source}; make the set anew with `playbot bugs make`")]
    Level {
        /// The mutant or the sound level.
        subject: String,
        /// Why.
        source: ModeError,
    },
    /// A defect that the program does not know.
    #[error(
        "{subject} cannot be planted: this program has no defect `{class}`; make the set anew with `playbot bugs make`"
    )]
    Unknown {
        /// The mutant.
        subject: String,
        /// Class of the defect.
        class: String,
    },
    /// A tester cannot play the game at all.
    #[error(transparent)]
    Test(#[from] TestError),
    /// A tester cannot see the game.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// An explorer cannot explore at all.
    #[error(transparent)]
    Explore(#[from] ExploreError),
    /// There is a score already.
    #[error("{} is there already: go on with --resume, choose another --out, or replace it with --force", .0.display())]
    Exists(PathBuf),
    /// Another process writes it.
    #[error("{} is in use by another score: wait for it or stop it, or choose another --out", .0.display())]
    Busy(PathBuf),
    /// What was begun is another score.
    #[error(
        "{} was begun as another score: {}; call with the same, choose another --out, or replace it with --force",
        path.display(), differences.join(", ")
    )]
    OtherScore {
        /// Its file.
        path: PathBuf,
        /// What differs, each in words.
        differences: Vec<String>,
    },
    /// A file is no score.
    #[error("{}: {why}; name a file that `playbot bugs score` has written", path.display())]
    NoScore {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// Two scores hold the same.
    #[error(
        "{} and {} both score {what}: name each score once, and scores of different games or sets",
        first.display(), second.display()
    )]
    Twice {
        /// One file.
        first: PathBuf,
        /// The other one.
        second: PathBuf,
        /// A subject of both.
        what: String,
    },
    /// Scores that were not made in the same way.
    #[error(
        "{} and {} cannot be joined: {}; score both in the same way",
        first.display(), second.display(), differences.join(", ")
    )]
    Unlike {
        /// One file.
        first: PathBuf,
        /// The other one.
        second: PathBuf,
        /// What differs, each in words.
        differences: Vec<String>,
    },
    /// No score was named.
    #[error("there is nothing to join: name at least one file that `playbot bugs score` has written")]
    Nothing,
    /// The operating system refused.
    #[error("cannot {action} {}: {source}; {}", path.display(), next_step(action))]
    Io {
        /// What was tried.
        action: &'static str,
        /// On which file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
}

impl ScoreError {
    /// Whether calling differently helps; otherwise the game or the system failed.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Test(error) => error.is_usage(),
            Self::Set(error) => error.is_usage(),
            Self::Explore(error) => !matches!(error, ExploreError::Fault(_) | ExploreError::Diverged { .. }),
            Self::Io { source, .. } => source.kind() == io::ErrorKind::NotFound,
            _ => true,
        }
    }
}

/// What to do where the system refused.
fn next_step(action: &str) -> &'static str {
    match action {
        "read" => "name a file that is there, as `playbot bugs score` has written it",
        _ => "make room or rights there, or name another file, and call this again",
    }
}

pub(super) fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> ScoreError {
    move |source| ScoreError::Io { action, path: path.into(), source }
}

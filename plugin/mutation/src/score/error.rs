//! Errors of scoring testers.

use crate::bugs::BugError;
use bevy_playbot::vision::VisionError;
use playbot_harness::mode::ModeError;
use playbot_learner::HasExitCode;
use playbot_test::{explore::ExploreError, verdict::TestError};
use std::{
    io,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// The reason why testers cannot be scored, or scores cannot be used.
#[derive(Debug, Error)]
pub enum ScoreError {
    /// The set has no mutant of the named games.
    #[error(
        "the set has no mutant of {0}: name the folder of another set, or score with the program that has its games"
    )]
    NoMutant(String),
    /// A game has no tester.
    #[error("`{0}` has no tester: name one of its bots, or a policy")]
    NoTester(String),
    /// Two testers of a game have the same name.
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
    /// A level cannot be played, for a reason that is no finding.
    #[error("{subject} cannot be played: {source}; make the set again with `playbot bugs make`")]
    Level {
        /// The mutant or the unmutated level.
        subject: String,
        /// The reason.
        source: ModeError,
    },
    /// The program does not know the defect.
    #[error(
        "{subject} cannot be planted: this program has no defect `{class}`; make the set again with `playbot bugs make`"
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
    /// The game cannot draw the picture that a tester needs.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// An explorer cannot explore at all.
    #[error(transparent)]
    Explore(#[from] ExploreError),
    /// The score exists already.
    #[error("{} is there already: go on with --resume, choose another --out, or replace it with --force", .0.display())]
    Exists(PathBuf),
    /// Another process writes the score.
    #[error("{} is in use by another score: wait for it or stop it, or choose another --out", .0.display())]
    Busy(PathBuf),
    /// The journal belongs to another score.
    #[error(
        "{} was started with other settings: {}; use the same ones, choose another --out, or replace it with --force",
        path.display(), differences.join(", ")
    )]
    OtherScore {
        /// Its file.
        path: PathBuf,
        /// Each difference, in words.
        differences: Vec<String>,
    },
    /// A file is not a score.
    #[error("{}: {why}; name a file that `playbot bugs score` has written", path.display())]
    NoScore {
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
    /// Two scores have a subject in common.
    #[error(
        "{} and {} both score {what}: name each score once, and scores of different games or sets",
        first.display(), second.display()
    )]
    Twice {
        /// One file.
        first: PathBuf,
        /// The other one.
        second: PathBuf,
        /// The common subject.
        what: String,
    },
    /// Scores that were made with different settings.
    #[error(
        "{} and {} cannot be joined: {}; score both with the same settings",
        first.display(), second.display(), differences.join(", ")
    )]
    Unlike {
        /// One file.
        first: PathBuf,
        /// The other one.
        second: PathBuf,
        /// Each difference, in words.
        differences: Vec<String>,
    },
    /// No score was named.
    #[error("no score to join: name at least one file that `playbot bugs score` has written")]
    Nothing,
    /// The system cannot read or write a file.
    #[error("cannot {action} {}: {source}; {}", path.display(), next_step(action))]
    Io {
        /// The action that failed.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

impl HasExitCode for ScoreError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Test(error) => error.exit_code(),
            Self::Set(error) => error.exit_code(),
            Self::Explore(ExploreError::Fault(_) | ExploreError::Diverged { .. }) => 2,
            Self::Io { source, .. } if source.kind() != io::ErrorKind::NotFound => 2,
            _ => 3,
        }
    }
}

/// Returns the next step after an error of the system.
fn next_step(action: &str) -> &'static str {
    match action {
        "read" => "name an existing file that `playbot bugs score` has written",
        _ => "check free space and permissions, or name another file, and run the command again",
    }
}

pub(super) fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> ScoreError {
    move |source| ScoreError::Io { action, path: path.into(), source }
}

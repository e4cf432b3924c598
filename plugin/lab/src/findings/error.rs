//! Errors of files of findings.

use std::{
    io,
    path::{Path, PathBuf},
};

use bevy_playbot::demo::file::{DemoFault, DemoFileError};
use playbot_learner::{HasExitCode, io_exit_code};
use thiserror::Error;

/// The reason why findings cannot be read or written.
#[derive(Debug, Error)]
pub enum FindingError {
    /// The file cannot be read as a recording, or cannot be written.
    #[error("{}", file_words(.0))]
    File(#[from] DemoFileError),
    /// It is a recording without the head of a finding.
    #[error("{}", no_finding_words(path, game))]
    NoFinding {
        /// The file.
        path: PathBuf,
        /// The game that was recorded.
        game: String,
    },
    /// The head was written by a later version.
    #[error("{}: a finding in form {found}, but this program reads forms up to {newest}: update the program", path.display())]
    NewerForm {
        /// The file.
        path: PathBuf,
        /// Form of the head.
        found: u32,
        /// Newest form that is read.
        newest: u32,
    },
    /// It has no episode or several ones.
    #[error("{}: {episodes} episodes, but a finding has one: test the level again with `playbot test`", path.display())]
    Episodes {
        /// The file.
        path: PathBuf,
        /// Number of episodes.
        episodes: usize,
    },
    /// A folder has no findings.
    #[error(
        "{} has no findings: name a folder with .finding files, or one that `playbot test` has written with findings in it; \
         where a test has found nothing, there is nothing to play again", .0.display()
    )]
    None(PathBuf),
    /// There is no such folder.
    #[error(
        "{} is not a folder: name one with .finding files, such as one that `playbot test` has written; a \
         single finding is played by `playbot replay`", .0.display()
    )]
    NoFolder(PathBuf),
    /// The pins cannot be parsed.
    #[error(
        "{}, line {line}, column {column}: {message}; write \
         [(finding: \"NAME\", reason: \"why it is known\", until: \"2027-01-31\")]", path.display()
    )]
    Pins {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// The error.
        message: String,
    },
    /// The system cannot read or write a file.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// The action that failed.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

impl HasExitCode for FindingError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::File(DemoFileError { fault: DemoFault::Io { source, .. }, .. }) | Self::Io { source, .. } => {
                io_exit_code(source)
            }
            Self::File(DemoFileError { fault: DemoFault::PushFailed { .. } | DemoFault::PushTorn { .. }, .. }) => 2,
            _ => 3,
        }
    }
}

/// Returns the message about a file, with the next step. A finding is a single episode, so it cannot be repaired.
fn file_words(error: &DemoFileError) -> String {
    let path = error.path.display();
    match &error.fault {
        DemoFault::Io { source, .. } if source.kind() == io::ErrorKind::NotFound => format!(
            "{path}: there is no such file: name a .finding that `playbot test` has written, as in \
             runs/test/findings/NAME.finding"
        ),
        DemoFault::NewerFormat { .. }
        | DemoFault::Io { .. }
        | DemoFault::PushFailed { .. }
        | DemoFault::PushTorn { .. } => error.to_string(),
        fault => {
            let what = fault.to_string();
            let what = what.split("; run `playbot demo repair").next().unwrap_or_default();
            format!("{path}: {what}; test the level again with `playbot test`, which writes its findings again")
        }
    }
}

/// Returns the message about a recording that is not a finding, with the next step.
fn no_finding_words(path: &Path, game: &str) -> String {
    let (shown, word) = (path.display(), word(path));
    format!(
        "{shown}: a recording, but not a finding: `playbot demo show {word}` says what is in it, `playbot view {game} \
         --demo {word}` shows it; a finding is a .finding that `playbot test` has written"
    )
}

/// Returns a path as one word of a command.
fn word(path: &Path) -> String {
    let name = path.display().to_string();
    if name.contains(char::is_whitespace) { format!("'{name}'") } else { name }
}

pub(super) fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> FindingError {
    move |source| FindingError::Io { action, path: path.into(), source }
}

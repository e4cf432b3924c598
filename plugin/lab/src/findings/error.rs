//! What can be wrong with files of findings.

use std::{
    io,
    path::{Path, PathBuf},
};

use bevy_playbot::demo::file::{DemoFault, DemoFileError};
use thiserror::Error;

/// Findings cannot be read or written.
#[derive(Debug, Error)]
pub enum FindingError {
    /// The file cannot be read as a recording, or not be written.
    #[error("{}", file_words(.0))]
    File(#[from] DemoFileError),
    /// It is a recording without a head.
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
    /// It holds none or several episodes.
    #[error("{}: {episodes} episodes, but a finding has one: test the level again with `playbot test`", path.display())]
    Episodes {
        /// The file.
        path: PathBuf,
        /// How many.
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
        "{} is no folder: name one with .finding files, such as one that `playbot test` has written; a single finding is \
         played by `playbot replay`", .0.display()
    )]
    NoFolder(PathBuf),
    /// The pins cannot be understood.
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
        /// What is wrong.
        message: String,
    },
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// On which file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
}

impl FindingError {
    /// Whether calling differently helps; otherwise the system failed.
    pub fn is_usage(&self) -> bool {
        use io::ErrorKind::{IsADirectory, NotADirectory, NotFound};
        let is_named = |source: &io::Error| matches!(source.kind(), NotFound | IsADirectory | NotADirectory);
        match self {
            Self::File(DemoFileError { fault: DemoFault::Io { source, .. }, .. }) | Self::Io { source, .. } => {
                is_named(source)
            }
            Self::File(DemoFileError { fault: DemoFault::PushFailed { .. } | DemoFault::PushTorn { .. }, .. }) => false,
            _ => true,
        }
    }
}

/// What is wrong with a file, and what helps. A finding is a single episode, so nothing of it can be repaired.
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
            format!("{path}: {what}; test the level again with `playbot test`, which writes its findings anew")
        }
    }
}

/// What helps with a recording that is no finding.
fn no_finding_words(path: &Path, game: &str) -> String {
    let (shown, word) = (path.display(), word(path));
    format!(
        "{shown}: a recording, but of no finding: `playbot demo show {word}` says what is in it, `playbot view {game} \
         --demo {word}` shows it; a finding is a .finding that `playbot test` has written"
    )
}

/// A path as one word of a command.
fn word(path: &Path) -> String {
    let name = path.display().to_string();
    if name.contains(char::is_whitespace) { format!("'{name}'") } else { name }
}

pub(super) fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> FindingError {
    move |source| FindingError::Io { action, path: path.into(), source }
}

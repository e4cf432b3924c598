//! What can be wrong with a demonstration file, and how it is said.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::EpisodeFault;

/// A problem with one demonstration file: which file, and what is wrong with it.
#[derive(Debug, Error)]
#[error("{}: {}", path.display(), advised(fault, path))]
pub struct DemoFileError {
    /// The file (or folder) the problem is about.
    pub path: PathBuf,
    /// What is wrong.
    pub fault: DemoFault,
}

impl DemoFileError {
    pub(super) fn new(path: &Path, fault: impl Into<DemoFault>) -> Self {
        Self { path: path.to_owned(), fault: fault.into() }
    }

    /// Whether `playbot demo repair` can do something about it: the header is sound and frames are not.
    #[cfg(test)]
    pub(super) fn is_repairable(&self) -> bool {
        matches!(
            self.fault,
            DemoFault::BadFrameMagic { .. }
                | DemoFault::TruncatedFrame { .. }
                | DemoFault::FrameChecksum { .. }
                | DemoFault::BadEpisode { .. }
        )
    }
}

/// A fault in words, whose command to repair `FILE` names this file.
fn advised(fault: &DemoFault, path: &Path) -> String {
    let name = path.display().to_string();
    let word = if name.contains(char::is_whitespace) { format!("'{name}'") } else { name };
    fault.to_string().replace("`playbot demo repair FILE", &format!("`playbot demo repair {word}"))
}

/// The ways a demonstration file can be wrong.
///
/// `offset` is a byte offset from the start of the file, `episode` counts from 0.
#[derive(Debug, Error)]
pub enum DemoFault {
    /// The operating system refused.
    #[error("cannot {action}: {source}")]
    Io {
        /// What was tried, as a verb phrase: "open the file", "write the header".
        action: &'static str,
        /// The answer of the operating system.
        source: std::io::Error,
    },
    /// The file does not begin like a demonstration file.
    #[error(
        "not a demonstration file: it begins with \"{found}\" instead of \"playbot-demo\"; run `playbot demo repair \
         FILE` if it was one, which takes the copy of its header, or with --header-from that of another recording"
    )]
    NotADemo {
        /// The first bytes of the file, with unprintable ones escaped.
        found: String,
    },
    /// The file ends before its header does.
    #[error("the file ends inside its header, after {length} bytes: it holds no episode")]
    TruncatedHeader {
        /// Length of the file in bytes.
        length: u64,
    },
    /// The first line is damaged.
    #[error(
        "the first line of the file is damaged (\"{found}\"): {why}; \
         run `playbot demo repair FILE`, which takes its copy, or with --header-from that of another recording"
    )]
    HeaderLine {
        /// The line, with unprintable characters escaped.
        found: String,
        /// What is wrong with it.
        why: &'static str,
    },
    /// The header is not the RON text that is expected.
    #[error(
        "the header does not parse at line {line}, column {column}: {message}; \
         run `playbot demo repair FILE`, which takes its copy, or with --header-from that of another recording"
    )]
    HeaderSyntax {
        /// Line in the file, from 1 (line 1 is the `playbot-demo` line).
        line: usize,
        /// Column, from 1.
        column: usize,
        /// The parser's words.
        message: String,
    },
    /// The header parses, but it is not the header that was written.
    #[error(
        "the header does not match its checksum: it was damaged or edited by hand; \
         run `playbot demo repair FILE`, which takes its copy, or with --header-from that of another recording"
    )]
    HeaderChecksum,
    /// The header is damaged, and so is its copy, so that nothing in the file says what its episodes are of.
    #[error(
        "{what}; no copy of its header is sound either: take that of another recording of the same game, mode and version with \
         `playbot demo repair FILE --header-from OTHER`"
    )]
    HeaderLost {
        /// What is wrong with the header, in words.
        what: String,
    },
    /// A value in the header makes no sense.
    #[error("header field `{field}`: {why}")]
    HeaderValue {
        /// Name of the field.
        field: &'static str,
        /// Why the value is refused.
        why: String,
    },
    /// The file was written by a later version of this crate.
    #[error("written in format {found}, but this program reads formats up to {newest}: update the program")]
    NewerFormat {
        /// Format of the file.
        found: u32,
        /// Newest format this program reads.
        newest: u32,
    },
    /// There is something else than a frame where a frame must begin.
    #[error(
        "episode {episode}: no frame begins at byte {offset} (the bytes there are damaged); \
         run `playbot demo repair FILE`"
    )]
    BadFrameMagic {
        /// Where the frame had to begin.
        offset: u64,
        /// Index of the episode.
        episode: usize,
    },
    /// The file ends before the frame does: the program or the machine stopped while writing.
    #[error(
        "episode {episode}: the frame at byte {offset} is cut off ({missing} bytes are missing); \
         run `playbot demo repair FILE`"
    )]
    TruncatedFrame {
        /// Where the frame begins.
        offset: u64,
        /// Index of the episode.
        episode: usize,
        /// How many bytes the frame announces beyond the end of the file.
        missing: u64,
    },
    /// A frame does not match its checksum.
    #[error(
        "episode {episode}: the frame at byte {offset} does not match its checksum; \
         run `playbot demo repair FILE`"
    )]
    FrameChecksum {
        /// Where the frame begins.
        offset: u64,
        /// Index of the episode.
        episode: usize,
    },
    /// A frame is what was written, but not a valid episode of this file.
    #[error("episode {episode} (frame at byte {offset}): {fault}")]
    BadEpisode {
        /// Where the frame begins.
        offset: u64,
        /// Index of the episode.
        episode: usize,
        /// What is wrong with the episode.
        fault: EpisodeFault,
    },
    /// An episode was refused before anything was written.
    #[error("the episode was not written: {0}")]
    RefusedEpisode(EpisodeFault),
    /// The recording is of another game.
    #[error("a recording of the game `{found}`, not of `{expected}`: choose recordings of `{expected}`")]
    ForeignGame {
        /// Game of the file.
        found: String,
        /// Game that was asked for.
        expected: String,
    },
    /// The recording is of another version of the game, whose rules may differ.
    #[error(
        "recorded with version {found} of `{game}`, but this is version {expected}: \
         the recording would not replay; record it again"
    )]
    ForeignVersion {
        /// The game.
        game: String,
        /// Version in the file.
        found: u32,
        /// Version that was asked for.
        expected: u32,
    },
    /// The recording is of another mode of the game.
    #[error("recorded in mode `{found}` of `{game}`, not in mode `{expected}`")]
    ForeignMode {
        /// The game.
        game: String,
        /// Mode of the file.
        found: String,
        /// Mode that was asked for.
        expected: String,
    },
    /// Episodes cannot be appended because the file was recorded under other conditions.
    #[error("cannot append: `{field}` is {found} in the file, but {wanted} is being recorded: record to another file")]
    HeaderDiffers {
        /// The first header field that differs.
        field: &'static str,
        /// Its value in the file.
        found: String,
        /// Its value in the new recording.
        wanted: String,
    },
    /// The file cannot be merged with another one because it was recorded under other conditions.
    #[error("cannot be merged: `{field}` is {found}, but {expected} in {}", first.display())]
    MergeDiffers {
        /// The first header field that differs.
        field: &'static str,
        /// Its value in this file.
        found: String,
        /// Its value in the first file.
        expected: String,
        /// The first file.
        first: PathBuf,
    },
    /// The file was named before among those to merge.
    #[error("named twice: its episodes would be in the merged file twice")]
    NamedTwice,
    /// No recording was named.
    #[error("there is nothing to merge: name the recordings that shall be in it")]
    NothingToMerge,
    /// The file exists already.
    #[error("exists already; nothing was written")]
    Exists,
    /// Another program is writing to the file.
    #[error("another program is recording to this file")]
    Locked,
    /// An episode could not be written; the file holds the episodes before it, whole.
    #[error("episode {episode} could not be written ({source}); the {episode} episodes before it are kept")]
    PushFailed {
        /// Index of the episode that is lost.
        episode: usize,
        /// The answer of the operating system.
        source: std::io::Error,
    },
    /// An episode could not be written, and part of it could not be removed again.
    #[error(
        "episode {episode} could not be written ({source}), and its remains could not be removed ({cleanup}); \
         the episodes before it are kept; run `playbot demo repair FILE`"
    )]
    PushTorn {
        /// Index of the episode that is lost.
        episode: usize,
        /// Why the episode was not written.
        source: std::io::Error,
        /// Why the remains were not removed.
        cleanup: std::io::Error,
    },
    /// The writer gave up after [`DemoFault::PushTorn`].
    #[error("an earlier episode was written in part, so no more can follow it; run `playbot demo repair FILE`")]
    Torn,
    /// A folder holds no demonstration file.
    #[error("no *.demo file in this folder or below it")]
    NoDemos,
}

impl DemoFault {
    /// This fault where it is known that the copy of the header is no help.
    pub(super) fn without_copy(self) -> Self {
        match self {
            Self::NotADemo { .. } | Self::HeaderLine { .. } | Self::HeaderSyntax { .. } | Self::HeaderChecksum => {
                let words = self.to_string();
                let what = words.split("; run `playbot demo repair").next().unwrap_or_default();
                Self::HeaderLost { what: what.to_owned() }
            }
            other => other,
        }
    }

    /// For `map_err`: what was tried when the operating system refused.
    pub(super) fn io(action: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Io { action, source }
    }
}

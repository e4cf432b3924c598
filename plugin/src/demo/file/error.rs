//! Errors of recordings, and their messages.

use playbot_learner::{HasExitCode, io_exit_code};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A problem with one recording: its path and the fault.
#[derive(Debug, Error)]
#[error("{}: {}", path.display(), advised(fault, path))]
pub struct DemoFileError {
    /// The file (or folder) with the problem.
    pub path: PathBuf,
    /// The fault.
    pub fault: DemoFault,
}

impl HasExitCode for DemoFileError {
    fn exit_code(&self) -> u8 {
        match &self.fault {
            DemoFault::Io { source, .. } => io_exit_code(source),
            DemoFault::PushFailed { .. } | DemoFault::PushTorn { .. } | DemoFault::Torn => 2,
            _ => 3,
        }
    }
}

impl DemoFileError {
    pub(super) fn new(path: &Path, fault: impl Into<DemoFault>) -> Self {
        Self { path: path.to_owned(), fault: fault.into() }
    }

    /// Returns whether `playbot demo repair` can help: the header is valid and some frames are not.
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

/// Returns the message of a fault, with `FILE` in the repair command replaced by this file.
fn advised(fault: &DemoFault, path: &Path) -> String {
    let name = path.display().to_string();
    let word = if name.contains(char::is_whitespace) { format!("'{name}'") } else { name };
    fault.to_string().replace("`playbot demo repair FILE", &format!("`playbot demo repair {word}"))
}

/// Returns what to do with two recordings that differ in this field. Learners take recordings of different noise, and of
/// observations that are kept or not.
fn instead_of_merge(field: &str) -> &'static str {
    match field {
        "noise" | "observation_names" => {
            "put both into one folder, from which `learn-skills` and `train` learn without a merge (--set demos=FOLDER)"
        }
        _ => "leave one of them out",
    }
}

/// The fault of a recording.
///
/// `offset` is a byte offset from the start of the file, `episode` counts from 0.
#[derive(Debug, Error)]
pub enum DemoFault {
    /// The operating system refused.
    #[error("cannot {action}: {source}")]
    Io {
        /// The attempted action, as a verb phrase: "open the file", "write the header".
        action: &'static str,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The file does not begin like a recording.
    #[error(
        "not a recording: it begins with \"{found}\" instead of \"playbot-demo\"; \
         run `playbot demo repair FILE` if it was one, which restores its header from the copy, or with --header-from \
         from another recording"
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
         run `playbot demo repair FILE`, which restores it from its copy, or with --header-from from another recording"
    )]
    HeaderLine {
        /// The line, with unprintable characters escaped.
        found: String,
        /// The problem.
        why: &'static str,
    },
    /// The header is not the RON text that is expected.
    #[error(
        "the header does not parse at line {line}, column {column}: {message}; \
         run `playbot demo repair FILE`, which restores it from its copy, or with --header-from from another recording"
    )]
    HeaderSyntax {
        /// Line in the file, from 1 (line 1 is the `playbot-demo` line).
        line: usize,
        /// Column, from 1.
        column: usize,
        /// The parser's message.
        message: String,
    },
    /// The header parses, but differs from the header that was written.
    #[error(
        "the header does not match its checksum: it was damaged or edited by hand; \
         run `playbot demo repair FILE`, which restores it from its copy, or with --header-from from another recording"
    )]
    HeaderChecksum,
    /// The header and its copy are damaged, so the file no longer identifies its episodes.
    #[error(
        "{what}; the copy of its header is damaged, too: take the header of another recording of the same game, mode \
         and version with `playbot demo repair FILE --header-from OTHER`"
    )]
    HeaderLost {
        /// The problem of the header, as text.
        what: String,
    },
    /// A value in the header makes no sense.
    #[error("header field `{field}`: {why}")]
    HeaderValue {
        /// Name of the field.
        field: &'static str,
        /// The reason why the value is refused.
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
    /// No frame begins where one must begin.
    #[error(
        "episode {episode}: no frame begins at byte {offset} (the bytes there are damaged); \
         run `playbot demo repair FILE`"
    )]
    BadFrameMagic {
        /// Byte offset at which the frame had to begin.
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
        /// Byte offset of the frame.
        offset: u64,
        /// Index of the episode.
        episode: usize,
        /// Bytes that the frame announces beyond the end of the file.
        missing: u64,
    },
    /// A frame does not match its checksum.
    #[error(
        "episode {episode}: the frame at byte {offset} does not match its checksum; \
         run `playbot demo repair FILE`"
    )]
    FrameChecksum {
        /// Byte offset of the frame.
        offset: u64,
        /// Index of the episode.
        episode: usize,
    },
    /// A frame is intact, but not a valid episode of this file.
    #[error("episode {episode} (frame at byte {offset}): {fault}")]
    BadEpisode {
        /// Byte offset of the frame.
        offset: u64,
        /// Index of the episode.
        episode: usize,
        /// The fault of the episode.
        fault: EpisodeFault,
    },
    /// An episode was refused before anything was written.
    #[error("the episode was not written: {0}")]
    RefusedEpisode(EpisodeFault),
    /// The recording belongs to another game.
    #[error("a recording of the game `{found}`, not of `{expected}`: choose recordings of `{expected}`")]
    ForeignGame {
        /// Game of the file.
        found: String,
        /// Game that was asked for.
        expected: String,
    },
    /// The recording belongs to another version of the game, whose rules may differ.
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
    /// The recording belongs to another mode of the game.
    #[error("recorded in mode `{found}` of `{game}`, not in mode `{expected}`: name recordings of one mode")]
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
    #[error("cannot be merged: `{field}` is {found}, but {expected} in {}: {}", first.display(), instead_of_merge(field))]
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
    /// The file appears twice among those to merge.
    #[error("named twice: its episodes would be in the merged file twice")]
    NamedTwice,
    /// The file is a copy of another one of those to merge.
    #[error("it is a copy of {}, whose episodes would be in the merged file twice: leave one of them out", .0.display())]
    CopyOf(PathBuf),
    /// No recording was named.
    #[error("there is nothing to merge: name the recordings to merge")]
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
        /// The error of the operating system.
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
        /// The reason why the episode was not written.
        source: std::io::Error,
        /// The reason why the rest was not removed.
        cleanup: std::io::Error,
    },
    /// The writer gave up after [`DemoFault::PushTorn`].
    #[error("an earlier episode was written in part, so no more can follow it; run `playbot demo repair FILE`")]
    Torn,
    /// A folder holds no recording.
    #[error("no *.demo file in this folder or below it")]
    NoDemos,
}

impl DemoFault {
    /// Returns this fault for a file whose header's copy is known to be unusable.
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

    /// Returns a function for `map_err` that names the attempted action.
    pub(super) fn io(action: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Io { action, source }
    }
}

/// The fault of an episode.
///
/// `step` counts the ticks of the episode from 0.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum EpisodeFault {
    /// Two per-tick lists have different lengths.
    #[error("{found} {what} for {steps} steps (expected {expected})")]
    Length {
        /// Name of the list.
        what: &'static str,
        /// Entries found.
        found: usize,
        /// Entries expected.
        expected: usize,
        /// Steps of the episode: the number of its state hashes.
        steps: usize,
    },
    /// Discrete actions in a file of continuous ones, or another number of dimensions.
    #[error("the actions are {found}, but the header says {expected}")]
    ActionKind {
        /// Kind of the episode's actions.
        found: String,
        /// Kind of the header's actions.
        expected: String,
    },
    /// A discrete action the game does not have.
    #[error("action {action} at step {step} is out of range: the game has actions 0 to {}", count.saturating_sub(1))]
    ActionRange {
        /// The step.
        step: usize,
        /// The action.
        action: u32,
        /// Number of actions of the game.
        count: usize,
    },
    /// A value that is not a finite number.
    #[error("{what} at step {step} is {value}, not a finite number")]
    NotFinite {
        /// Name of the list.
        what: &'static str,
        /// The step.
        step: usize,
        /// The value: NaN or an infinity.
        value: f32,
    },
    /// The episode is too long for one frame.
    #[error("the episode takes {bytes} bytes, but a frame holds at most {limit}")]
    TooLarge {
        /// Size of the episode on disk.
        bytes: usize,
        /// Largest size of a frame.
        limit: usize,
    },
    /// The bytes of the frame contradict each other.
    #[error("malformed frame: {0}")]
    Malformed(String),
}

//! Findings as files: a detector's message, the actions that lead to it, and the check whether it still happens.
//!
//! - A [`StoredFinding`] is a recording of one episode, up to the tick of the finding. Its note is the [`FindingHead`]:
//!   tester, detector, message, tick and state hash.
//! - [`recheck()`] replays the actions in a World of their own and runs the detector's [`Check`]. [`Checks`] has them
//!   by name, and [`Checks::with`] adds one.
//! - [`minimise()`] leaves out actions that are not needed: ddmin (Zeller and Hildebrandt, Simplifying and isolating
//!   failure-inducing input, 2002).
//! - [`FindingFiles`] writes findings during a test. [`regress()`] replays all findings of a folder, with [`Pins`] for
//!   known ones.
//!
//! The files of the folder, in reading order:
//!
//! - `play`: the replay of an episode, by its actions or by its player.
//! - `checks`, `course`: the check of each detector, and the replay in search of a finding.
//! - `keep`, `folder`: the writer of findings during a test, and folders of findings.
//! - `scan`, `minimise`: the search for other findings in an episode, and the removal of actions.
//! - `regress`: the replay of a whole folder.

mod checks;
mod course;
mod folder;
pub mod keep;
pub mod minimise;
mod play;
pub mod regress;
pub mod scan;
#[cfg(test)]
mod stored_tests;
#[cfg(test)]
pub(crate) mod testing;

use crate::findings::{
    course::{Look, look},
    play::{Setting, recorded},
};
use bevy_playbot::{
    action::ActionValue,
    demo::file::{Decider, DemoEnd, DemoEpisode, DemoFault, DemoFileError, DemoHeader, DemoReader, DemoWriter},
    episode::EpisodeEnd,
};
use playbot_harness::game::Game;
use playbot_learner::{HasExitCode, disk, io_exit_code};
use serde::{Deserialize, Serialize};
use std::{
    io,
    path::{Path, PathBuf},
};
use thiserror::Error;

pub use crate::findings::{
    checks::{Check, Checks, LOST, NOT_SOLVED, REPORT},
    course::{CourseEnd, RecordedCourse, course_of, course_of_recording, keeps_course},
    folder::{Date, DateError, FINDINGS, clear_findings, first_finding, gather_findings, list_findings},
    keep::{FindingFiles, KeptFailure, Played, Recheck, SeenFinding, SeenLevel, Sighting, recheck},
    minimise::{Budget, Lengths, Minimised, actions_of, lengths, minimise},
    play::{Breakage, CheckTick, Replayed, Unplayable, Watcher},
    regress::{PINS, Pin, PinState, Pins, Regress, RegressRow, Regression, regress, regress_until},
    scan::scan,
};
pub(crate) use crate::findings::{
    folder::DAY,
    play::{Setting as PlayedSetting, detector_of, play_actions, play_player, since_edited},
};

/// Newest form of the head that is read and written.
const HEAD_FORMAT: u32 = 1;

/// A finding with the actions that lead to it.
///
/// Its file is a recording of one episode, in the format of all recordings
/// ([`bevy_playbot::demo::file`]): framed, checksummed, and readable by every program that reads recordings. The
/// head is the note of the recording.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredFinding {
    /// Game, version, mode and kind of actions. The note is written from the head.
    pub header: DemoHeader,
    /// The description of the finding.
    pub head: FindingHead,
    /// The episode up to the tick of the finding; without ticks if the finding needs no play.
    pub episode: DemoEpisode,
}

impl StoredFinding {
    /// Plays actions on a level and searches for the finding with its detector's check. Later ticks are cut off. The
    /// head gets tick, state hash and, if it is unknown, original length.
    ///
    /// `None` if the finding does not happen, or there is no check of that name.
    pub fn of_actions(
        game: &dyn Game,
        mode: &str,
        level: u64,
        head: FindingHead,
        actions: &[ActionValue],
        checks: &Checks,
    ) -> Option<Self> {
        let setting = Setting { game, mode, level, seed: head.seed };
        let Look { is_there, tick, replayed, .. } = look(setting, &head, actions, &checks.of_finding(game, &head)?);
        is_there.then(|| Self::of_replay(setting, head, actions, replayed, tick))
    }

    /// Creates a finding from replayed actions.
    fn of_replay(
        setting: Setting,
        mut head: FindingHead,
        actions: &[ActionValue],
        replayed: Replayed,
        tick: Option<u32>,
    ) -> Self {
        let Setting { game, mode, level, .. } = setting;
        let ticks = tick.map_or(0, |tick| actions.len().min(tick as usize + 1));
        head.tick = tick;
        head.state_hash = tick.and_then(|tick| replayed.state_hash(tick));
        if head.original_ticks == 0 {
            head.original_ticks = u32::try_from(actions.len()).unwrap_or(u32::MAX);
        }
        let mut header = game.demo_header(mode);
        header.demonstrator = head.tester.clone().unwrap_or_default();
        let end = replayed.end.filter(|end| end.ticks as usize == ticks).map(|end| end.end);
        // A tick in which a game breaks has no reward and no state.
        let mut rewards: Vec<f32> =
            replayed.rewards.iter().map(|reward| if reward.is_finite() { *reward } else { 0.0 }).collect();
        rewards.resize(ticks, 0.0);
        let mut state_hashes = replayed.state_hashes;
        let last = state_hashes.last().copied().unwrap_or(0);
        state_hashes.resize(ticks, last);
        // The tick in which a game breaks is not among the played ones.
        let played = replayed.actions.iter().chain(actions.iter().skip(replayed.actions.len()));
        let played: Vec<ActionValue> = played.take(ticks).cloned().collect();
        let mut episode = DemoEpisode::new(level, header.actions);
        episode.level_file = replayed.level_file;
        episode.actions = recorded(&played, &game.actions());
        episode.deciders = vec![Decider::Bot; ticks];
        (episode.rewards, episode.state_hashes) = (rewards, state_hashes);
        episode.end = match end {
            Some(EpisodeEnd::Terminated { success }) => DemoEnd::Terminated { success },
            Some(EpisodeEnd::Truncated) => DemoEnd::Truncated,
            None => DemoEnd::Aborted,
        };
        Self { header, head, episode }
    }

    /// Returns the actions, one for each tick.
    pub fn actions(&self) -> Vec<ActionValue> {
        self.episode.actions.iter().collect()
    }

    /// Reads a file.
    ///
    /// # Errors
    ///
    /// It is not a recording, damaged, or a recording without the head of a finding.
    pub fn read(path: &Path) -> Result<Self, FindingError> {
        let reader = DemoReader::open(path)?;
        let header = reader.header().clone();
        let head = head_of(path, &header)?;
        let mut episodes = reader.read_all()?;
        match (episodes.pop(), episodes.len()) {
            (Some(episode), 0) => Ok(Self { header, head, episode }),
            (last, others) => {
                Err(FindingError::Episodes { path: path.into(), episodes: others + usize::from(last.is_some()) })
            }
        }
    }

    /// Writes a file atomically, and replaces an existing one. The same finding gives the same bytes.
    ///
    /// # Errors
    ///
    /// The system cannot write.
    pub fn write(&self, path: &Path) -> Result<(), FindingError> {
        let fresh = disk::temporary_name(path);
        let written = self.write_new(&fresh).and_then(|()| disk::rename(&fresh, path).map_err(io_error("write", path)));
        if written.is_err() {
            // The first error is the one to report.
            let _ = disk::remove_file(&fresh);
        }
        written
    }

    fn write_new(&self, path: &Path) -> Result<(), FindingError> {
        let note = ron::ser::to_string(&self.head)
            .map_err(|error| io_error("write", path)(io::Error::other(error.to_string())))?;
        let mut writer = DemoWriter::replace(path, DemoHeader { note, ..self.header.clone() })?;
        writer.push(&self.episode)?;
        Ok(())
    }
}

fn head_of(path: &Path, header: &DemoHeader) -> Result<FindingHead, FindingError> {
    let DemoHeader { note, game, .. } = header;
    // The parser's message is useless here: notes of recordings are free text.
    let none = |_: ron::error::SpannedError| FindingError::NoFinding { path: path.into(), game: game.clone() };
    let FormOnly { finding } = ron::from_str(note).map_err(none)?;
    if finding > HEAD_FORMAT {
        return Err(FindingError::NewerForm { path: path.into(), found: finding, newest: HEAD_FORMAT });
    }
    ron::from_str(note).map_err(none)
}

/// The description of a finding: RON text in the note of the recording. Older programs ignore fields that they do not
/// know.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FindingHead {
    /// Form of the head: 1.
    pub finding: u32,
    /// The level's name in results: `hard:7`, or the path of its file.
    pub level: String,
    /// The tester; `None` if the finding needs none.
    pub tester: Option<String>,
    /// Random seed of the agent in the episode.
    pub seed: u64,
    /// Name of the detector.
    pub detector: String,
    /// Tick of the finding in the episode, from 0; `None` if it needs no play.
    pub tick: Option<u32>,
    /// The message.
    pub message: String,
    /// Hash of the game's state after that tick, or after the last one before it if the game broke in it. `None` if
    /// there is no hash.
    pub state_hash: Option<u32>,
    /// Ticks of the episode before minimisation.
    pub original_ticks: u32,
    /// Settings of the detector that differ from the default, as `name.key=value`. Older files have no settings.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub settings: Vec<String>,
}

impl FindingHead {
    /// Creates the head of a finding whose tick is not known yet.
    pub fn new(level: impl Into<String>, detector: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            finding: HEAD_FORMAT,
            level: level.into(),
            tester: None,
            seed: 0,
            detector: detector.into(),
            tick: None,
            message: message.into(),
            state_hash: None,
            original_ticks: 0,
            settings: Vec::new(),
        }
    }
}

/// The part of a head that is read before its form is known.
#[derive(Deserialize)]
struct FormOnly {
    finding: u32,
}

/// The status of a replayed finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FindingStatus {
    /// It happens in the same tick with the same state.
    StillThere,
    /// It happens, in another tick or with another state.
    Changed,
    /// It does not happen any more.
    Gone,
    /// It cannot be played: the level no longer exists, the game differs, or the file is damaged.
    Unplayable,
}

impl FindingStatus {
    /// Returns the name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::StillThere => "still-there",
            Self::Changed => "changed",
            Self::Gone => "gone",
            Self::Unplayable => "unplayable",
        }
    }
}

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

fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> FindingError {
    move |source| FindingError::Io { action, path: path.into(), source }
}

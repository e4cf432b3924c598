//! Recordings: files of recorded episodes.
//!
//! A file begins as text, so `head` shows its contents, and goes on with one frame per episode:
//!
//! The files of the folder, in reading order:
//!
//! - `header`, `episode`: the header, and one episode in memory.
//! - `writer`, `reader`, [`mod@repair`]: writing, reading, and recovery of a damaged recording.
//! - `preamble`, `bytes`: the text at the top of the file, and the bytes of a frame.
//! - `error`: errors, and their messages.
//!
//! ```text
//! playbot-demo header=00000214 crc32=5d3a90c1     magic line: length and checksum of the header
//! (
//!     format: 1,                                  header, RON: see DemoHeader
//!     game: "coinrun",
//!     …
//! )
//! // playbot-demo header=00000102 crc32=0c1d2e3f  the same once more, as comments
//! // …
//! FE 45 50 FF | length | payload | CRC-32         a frame: see DemoEpisode
//! FE 45 50 FF | length | payload | CRC-32
//! ```
//!
//! - Files only grow. [`DemoWriter::push`] writes one frame with a single write and waits for the disk: after a
//!   crash, the episodes before it are still there.
//! - Everything is checked. [`DemoReader`] returns an episode only when its checksum holds, its lists agree in
//!   length, its actions are in range and its numbers are finite.
//! - The header is stored twice: if one copy is damaged, the other one identifies the recording.
//! - A damaged file is an error with a position. [`repair`](repair()) recovers every intact episode, also behind the
//!   damage.
//! - A tick of a game with at most 256 actions takes about 5 bytes: the action and the state hash.
//!   Rewards and deciders are stored as runs.

mod bytes;
mod episode;
mod error;
mod header;
mod preamble;
mod reader;
pub mod repair;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod writer;

use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

pub use crate::demo::file::header::DEMO_FORMAT;
pub use crate::demo::file::preamble::DEMO_MAGIC;
pub use crate::demo::file::repair::{DroppedRegion, RepairReport, repair};
pub use crate::demo::file::{
    episode::{Decider, DemoEnd, DemoEpisode, EpisodeActions},
    error::{DemoFault, DemoFileError, EpisodeFault},
    header::{DemoActions, DemoHeader},
    reader::DemoReader,
    writer::DemoWriter,
};

/// A summary of a recording in a few numbers.
///
/// Means and shares are `None` without episodes, not 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DemoSummary {
    /// The file.
    pub path: PathBuf,
    /// Its header.
    pub header: DemoHeader,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// Number of episodes.
    pub episodes: usize,
    /// Number of ticks over all episodes.
    pub steps: usize,
    /// Episodes that terminated with success.
    pub successes: usize,
    /// Episodes that terminated without success.
    pub failures: usize,
    /// Episodes that the time limit ended.
    pub truncated: usize,
    /// Episodes whose recording stopped before their end.
    pub aborted: usize,
    /// Share of episodes that terminated with success, 0 to 1, among those recorded to their end: `aborted` ones
    /// count neither as successes nor as failures.
    pub success_share: Option<f64>,
    /// Mean of the undiscounted returns.
    pub return_mean: Option<f64>,
    /// Mean number of ticks of an episode.
    pub length_mean: Option<f64>,
    /// Smallest level seed.
    pub level_seed_min: Option<u64>,
    /// Largest level seed.
    pub level_seed_max: Option<u64>,
    /// Number of different level seeds.
    pub levels: usize,
    /// Ticks of each decider; deciders without ticks are left out.
    pub steps_by_decider: BTreeMap<Decider, usize>,
}

impl DemoSummary {
    /// Reads the whole file and sums it up.
    ///
    /// # Errors
    ///
    /// The first error that [`DemoReader`] finds.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, DemoFileError> {
        let mut reader = DemoReader::open(path)?;
        let mut seeds = std::collections::BTreeSet::new();
        let mut summary = Self {
            path: reader.path().to_owned(),
            header: reader.header().clone(),
            bytes: reader.file_length(),
            episodes: 0,
            steps: 0,
            successes: 0,
            failures: 0,
            truncated: 0,
            aborted: 0,
            success_share: None,
            return_mean: None,
            length_mean: None,
            level_seed_min: None,
            level_seed_max: None,
            levels: 0,
            steps_by_decider: BTreeMap::new(),
        };
        let mut return_sum = 0.0;
        for episode in reader.by_ref() {
            let episode = episode?;
            summary.episodes += 1;
            summary.steps += episode.len();
            match episode.end {
                DemoEnd::Terminated { success: true } => summary.successes += 1,
                DemoEnd::Terminated { success: false } => summary.failures += 1,
                DemoEnd::Truncated => summary.truncated += 1,
                DemoEnd::Aborted => summary.aborted += 1,
            }
            return_sum += episode.episode_return();
            seeds.insert(episode.level_seed);
            for (decider, steps) in episode.steps_by_decider() {
                *summary.steps_by_decider.entry(decider).or_default() += steps;
            }
        }
        if summary.episodes > 0 {
            let episodes = summary.episodes as f64;
            summary.return_mean = Some(return_sum / episodes);
            summary.length_mean = Some(summary.steps as f64 / episodes);
        }
        let ended = summary.episodes - summary.aborted;
        summary.success_share = (ended > 0).then(|| summary.successes as f64 / ended as f64);
        summary.level_seed_min = seeds.first().copied();
        summary.level_seed_max = seeds.last().copied();
        summary.levels = seeds.len();
        Ok(summary)
    }
}

/// Returns the recordings at `path`: the file itself, or all `*.demo` files in a folder and its subfolders,
/// sorted by path. Links to folders are not followed.
///
/// # Errors
///
/// [`DemoFault::NoDemos`] for a folder without any, [`DemoFault::Io`] when `path` does not exist or
/// cannot be listed.
pub fn find_demos(path: impl AsRef<Path>) -> Result<Vec<PathBuf>, DemoFileError> {
    let path = path.as_ref();
    let metadata = fs::metadata(path)
        .map_err(|source| DemoFileError::new(path, DemoFault::Io { action: "find recordings", source }))?;
    if !metadata.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut found = Vec::new();
    let mut folders = vec![path.to_owned()];
    while let Some(folder) = folders.pop() {
        list(&folder, &mut folders, &mut found)
            .map_err(|source| DemoFileError::new(&folder, DemoFault::Io { action: "list the folder", source }))?;
    }
    if found.is_empty() {
        return Err(DemoFileError::new(path, DemoFault::NoDemos));
    }
    found.sort();
    Ok(found)
}

fn list(folder: &Path, folders: &mut Vec<PathBuf>, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let path = entry.path();
        if entry.file_type()?.is_dir() {
            folders.push(path);
        } else if path.extension().is_some_and(|e| e == "demo") && path.is_file() {
            found.push(path);
        }
    }
    Ok(())
}

// Merging of recordings.

/// Writes the episodes of several recordings of one game into a new file, in the order of `files`.
///
/// They must agree in everything that a replay depends on: game, version, mode, tick rate, actions, names of kept
/// observations and noise. Testers may differ: the new file names all of them. The input files stay unchanged.
///
/// ```no_run
/// use bevy_playbot::demo::file::{DemoFileError, merge_demos};
///
/// let report = merge_demos(&["ada.demo", "bob.demo"], "all.demo")?;
/// assert!(report.episodes() >= 2, "of the game {}", report.header.game);
/// # Ok::<(), DemoFileError>(())
/// ```
///
/// # Errors
///
/// The first file that belongs to another game, version or mode ([`DemoFault::ForeignGame`] and its kin), differs
/// otherwise ([`DemoFault::MergeDiffers`]), is damaged, or is named twice. [`DemoFault::Exists`] when there is a file
/// at `out`, and [`DemoFault::NothingToMerge`] without files. After an error there is no file at `out`.
pub fn merge_demos(files: &[impl AsRef<Path>], out: impl AsRef<Path>) -> Result<MergeReport, DemoFileError> {
    let out = out.as_ref();
    let Some(first) = files.first() else { return Err(DemoFileError::new(out, DemoFault::NothingToMerge)) };
    let mut readers = Vec::new();
    for (index, path) in files.iter().enumerate() {
        let path = path.as_ref();
        if files[..index].iter().any(|before| is_same(before.as_ref(), path)) {
            return Err(DemoFileError::new(path, DemoFault::NamedTwice));
        }
        if let Some(before) = files[..index].iter().find(|before| has_same_bytes(before.as_ref(), path)) {
            return Err(DemoFileError::new(path, DemoFault::CopyOf(before.as_ref().into())));
        }
        readers.push(DemoReader::open(path)?);
    }
    let header = common_header(first.as_ref(), &readers)?;
    let mut writer = DemoWriter::create(out, header.clone())?;
    let mut report = MergeReport { header, files: Vec::new(), steps: 0 };
    let copied = readers.into_iter().try_for_each(|mut reader| {
        for episode in reader.by_ref() {
            let episode = episode?;
            report.steps += episode.len();
            writer.push(&episode)?;
        }
        report.files.push((reader.path().to_owned(), reader.episodes_read()));
        Ok(())
    });
    if let Err(error) = copied {
        drop(writer);
        // An unfinished merge would look like a whole one.
        let _ = playbot_learner::disk::remove_file(out);
        return Err(error);
    }
    Ok(report)
}

/// The result of a merge.
#[derive(Clone, Debug, PartialEq)]
pub struct MergeReport {
    /// Header of the new file.
    pub header: DemoHeader,
    /// Each merged file with its number of episodes, in order.
    pub files: Vec<(PathBuf, usize)>,
    /// Ticks over all episodes.
    pub steps: usize,
}

impl MergeReport {
    /// Episodes of the new file.
    pub fn episodes(&self) -> usize {
        self.files.iter().map(|(_, episodes)| episodes).sum()
    }
}

/// Returns whether two paths lead to one file.
fn is_same(one: &Path, other: &Path) -> bool {
    match (one.canonicalize(), other.canonicalize()) {
        (Ok(one), Ok(other)) => one == other,
        _ => one == other,
    }
}

/// Returns whether two files are equal. Only files of one length are read.
fn has_same_bytes(one: &Path, other: &Path) -> bool {
    let length = |path: &Path| fs::metadata(path).ok().map(|data| data.len());
    // What cannot be read is an error when it is opened.
    length(one).is_some()
        && length(one) == length(other)
        && fs::read(one).is_ok_and(|bytes| fs::read(other).is_ok_and(|other| other == bytes))
}

/// Returns the common header of all these recordings.
fn common_header(first: &Path, readers: &[DemoReader]) -> Result<DemoHeader, DemoFileError> {
    let mut common = readers[0].header().clone();
    let mut names: Vec<String> = Vec::new();
    for reader in readers {
        let header = reader.header();
        let refuse = |fault| DemoFileError::new(reader.path(), fault);
        header.check_game(&common.game, common.game_version, Some(&common.mode)).map_err(refuse)?;
        let testers = DemoHeader { demonstrator: common.demonstrator.clone(), ..header.clone() };
        if let Err(fault) = testers.check_append(&common) {
            return Err(refuse(match fault {
                DemoFault::HeaderDiffers { field, found, wanted } => {
                    DemoFault::MergeDiffers { field, found, expected: wanted, first: first.to_owned() }
                }
                other => other,
            }));
        }
        for name in header.demonstrator.split(", ").filter(|name| !name.is_empty()) {
            if !names.iter().any(|known| known == name) {
                names.push(name.to_owned());
            }
        }
    }
    common.demonstrator = names.join(", ");
    Ok(common)
}

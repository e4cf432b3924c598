//! Recordings: files of recorded episodes.
//!
//! A file begins as text, so `head` shows its contents, and goes on with one frame per episode:
//!
//! The files of the folder, in reading order:
//!
//! - `header`, `episode`: the header, and one episode in memory.
//! - `writer`, `reader`, [`mod@repair`]: writing, reading, and recovery of a damaged recording.
//! - `copying`: new recordings of the episodes of others: joined, selected, or with another player's name.
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
mod copying;
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
    copying::{MergeReport, merge_demos, relabel_demo, repeated_episodes, select_demos},
    episode::{Decider, DemoEnd, DemoEpisode},
    error::{DemoFault, DemoFileError, EpisodeFault},
    header::DemoHeader,
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

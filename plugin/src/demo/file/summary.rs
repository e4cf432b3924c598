//! A summary of a recording in a few numbers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::episode::{Decider, DemoEnd};
use super::error::DemoFileError;
use super::header::DemoHeader;
use super::reader::DemoReader;

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

#[cfg(test)]
mod tests {
    use super::super::testing::{episode, write};
    use super::*;

    #[test]
    fn numbers_by_hand() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let lost =
            |seed, steps, end| super::super::DemoEpisode { end, rewards: vec![0.0; steps], ..episode(seed, steps) };
        let episodes = [
            episode(7, 4),
            lost(7, 6, DemoEnd::Terminated { success: false }),
            lost(9, 10, DemoEnd::Truncated),
            lost(9, 0, DemoEnd::Truncated),
            lost(2, 0, DemoEnd::Aborted),
        ];
        let summary = DemoSummary::read(write(folder.path(), "a.demo", &episodes)).expect("sound");
        assert_eq!((summary.episodes, summary.steps, summary.levels), (5, 20, 3));
        assert_eq!((summary.successes, summary.failures, summary.truncated, summary.aborted), (1, 1, 2, 1));
        assert_eq!(
            (summary.success_share, summary.return_mean, summary.length_mean),
            (Some(0.25), Some(2.0), Some(4.0))
        );
        assert_eq!((summary.level_seed_min, summary.level_seed_max), (Some(2), Some(9)));
        let deciders: Vec<_> = summary.steps_by_decider.clone().into_iter().collect();
        assert_eq!(deciders, [(Decider::Human, 6), (Decider::Bot, 14)]);
        let json = serde_json::to_string(&summary).expect("serialises");
        assert_eq!(serde_json::from_str::<DemoSummary>(&json).expect("reads back"), summary);
        assert!(json.contains("\"success_share\":0.25"), "{json}");
    }

    #[test]
    fn an_empty_recording_has_no_means() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let summary = DemoSummary::read(write(folder.path(), "a.demo", &[])).expect("sound");
        assert_eq!((summary.episodes, summary.success_share, summary.level_seed_min), (0, None, None));
    }
}

//! The tries of people in recordings.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use bevy_playbot::demo::file::{Decider, DemoEpisode, DemoHeader, DemoReader, find_demos};

use super::{
    error::CalibrationError,
    level_names::LevelNames,
    tries::{LevelTries, Try},
};
use crate::verdict::TestRecord;

/// Name of the person in a recording without a name.
const NAMELESS: &str = "human";

/// Tries of people, by level.
#[derive(Default)]
pub(super) struct People {
    pub levels: BTreeMap<String, LevelTries>,
    /// Episodes that a bot played, or a policy.
    by_others: u64,
    /// Episodes that were left before their end.
    unfinished: u64,
}

impl People {
    /// Reads the tries in these recordings, or in all recordings of a folder.
    pub fn read(
        recordings: &[PathBuf],
        results: &Path,
        record: &TestRecord,
        names: &LevelNames,
    ) -> Result<Self, CalibrationError> {
        let mut people = Self::default();
        // A file that is named twice counts once.
        let mut files = BTreeSet::new();
        for path in recordings {
            files.extend(find_demos(path)?);
        }
        for path in &files {
            let reader = DemoReader::open(path)?;
            let header = reader.header().clone();
            check(path, &header, results, record)?;
            let person = person(&header, path);
            for episode in reader {
                people.add(&person, &header, &episode?, names);
            }
        }
        if people.levels.is_empty() {
            let files: Vec<String> = recordings.iter().map(|path| path.display().to_string()).collect();
            return Err(CalibrationError::Nobody { files: files.join(", "), left_out: people.left_out() });
        }
        Ok(people)
    }

    fn add(&mut self, person: &str, header: &DemoHeader, episode: &DemoEpisode, names: &LevelNames) {
        if episode.is_empty() {
            return;
        }
        let by_hand = episode.deciders.iter().filter(|decider| **decider == Decider::Human).count();
        // A bot may have helped, but not played most of the episode.
        if 2 * by_hand <= episode.len() {
            self.by_others += 1;
            return;
        }
        let Some(one) = Try::of(episode) else {
            self.unfinished += 1;
            return;
        };
        for name in names.of_episode(header, episode) {
            self.levels.entry(name).or_default().add(person, one);
        }
    }

    /// Returns the counts of episodes that do not count, in words.
    pub fn left_out(&self) -> Vec<String> {
        let words = |count: u64, what: &str| {
            (count > 0).then(|| format!("{count} episode{} {what}", if count == 1 { "" } else { "s" }))
        };
        let (others, unfinished) = (self.by_others, self.unfinished);
        [words(others, "not played by a person"), words(unfinished, "left in the middle")]
            .into_iter()
            .flatten()
            .collect()
    }
}

fn check(path: &Path, header: &DemoHeader, results: &Path, record: &TestRecord) -> Result<(), CalibrationError> {
    let (path, results, game) = (path.to_owned(), results.to_owned(), record.game.clone());
    if header.game != game {
        return Err(CalibrationError::OtherGame { path, found: header.game.clone(), results, game });
    }
    let (found, version) = (header.game_version, record.game_version);
    if found == version { Ok(()) } else { Err(CalibrationError::OtherVersion { path, found, results, version, game }) }
}

/// Returns the person's name, or the file's if the recording has no name.
fn person(header: &DemoHeader, path: &Path) -> String {
    let name = header.demonstrator.trim();
    if name.is_empty() || name == NAMELESS { path.display().to_string() } else { name.to_owned() }
}

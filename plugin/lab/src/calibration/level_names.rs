//! The level names of recorded episodes, as results use them.

use std::{collections::BTreeMap, path::Path};

use bevy_playbot::demo::file::{DemoEpisode, DemoHeader};

use super::error::CalibrationError;
use crate::{
    game::{Game, read_level_designs},
    level_files::is_level_files,
    verdict::{TestRecord, hash_of_files},
};

/// The levels of results, as recordings know them.
pub(super) enum LevelNames {
    /// Generated from seeds: by mode and number.
    Seeds,
    /// Files: the names of all files with a level of this hash.
    Files(BTreeMap<u64, Vec<String>>),
}

impl LevelNames {
    /// Reads the levels of the results in this folder.
    pub fn of(results: &Path, record: &TestRecord, game: Option<&dyn Game>) -> Result<Self, CalibrationError> {
        if !is_level_files(&record.range.mode) {
            return Ok(Self::Seeds);
        }
        let no_game = || CalibrationError::NoGame { results: results.into(), game: record.game.clone() };
        let game = game.ok_or_else(no_game)?;
        let designs = read_level_designs(game, &record.range.mode)?;
        if hash_of_files(game, &record.range) != record.files {
            let range = record.range.to_string();
            return Err(CalibrationError::ChangedFiles { results: results.into(), range });
        }
        let mut names: BTreeMap<u64, Vec<String>> = BTreeMap::new();
        for level in record.range.levels() {
            if let (Some(hash), Some(path)) = (designs.hash(level), designs.path(level)) {
                names.entry(hash).or_default().push(path.to_owned());
            }
        }
        Ok(Self::Files(names))
    }

    /// Returns the names that results give to the level of an episode. Files with the same level have several names.
    pub fn of_episode(&self, header: &DemoHeader, episode: &DemoEpisode) -> Vec<String> {
        match (&episode.level_file, self) {
            (None, _) => vec![format!("{}:{}", header.mode, episode.level_seed)],
            (Some(file), Self::Files(names)) => {
                names.get(&file.hash).cloned().unwrap_or_else(|| vec![file.to_string()])
            }
            (Some(file), Self::Seeds) => vec![file.to_string()],
        }
    }
}

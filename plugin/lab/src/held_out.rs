//! Held-out levels, and checks that other levels do not show them.

use std::collections::BTreeSet;

use bevy_playbot::level_files::LevelFile;
use playbot_learner::SeenLevels;

use crate::{game::Game, level_files::is_level_files, split::LevelSplit};

/// Largest number of levels that are drawn and compared, which bounds the time for a range from a file.
const MOST_COMPARED: u64 = 1 << 18;

/// Held-out levels, kept unseen before the test: also under another mode's rules, or under another seed that draws
/// the same level.
pub struct HeldOut<'a> {
    game: &'a dyn Game,
    split: &'a LevelSplit,
    family: String,
    fingerprints: BTreeSet<u64>,
}

impl<'a> HeldOut<'a> {
    /// Holds out a split of a game whose mode has been checked with [`Game::check_mode`].
    pub fn new(game: &'a dyn Game, split: &'a LevelSplit) -> Self {
        let fingerprints = split.levels().filter_map(|level| game.fingerprint(&split.mode, level)).collect();
        Self { game, split, family: game.tools().levels.family(&split.mode), fingerprints }
    }

    /// Returns the levels as they were named.
    pub fn split(&self) -> &LevelSplit {
        self.split
    }

    /// Returns whether this level is held out, or looks like one that is.
    pub fn contains(&self, mode: &str, level: u64) -> bool {
        let is_named =
            self.split.contains(&self.split.mode, level) && self.game.tools().levels.family(mode) == self.family;
        is_named || self.game.fingerprint(mode, level).is_some_and(|print| self.fingerprints.contains(&print))
    }

    /// Returns whether the level in this file is held out, under any number.
    pub fn contains_file(&self, file: &LevelFile) -> bool {
        self.fingerprints.contains(&file.hash)
    }

    /// Returns the first of these levels that is held out.
    pub fn first_of(&self, levels: &LevelSplit) -> Option<u64> {
        self.first_by_number(levels).or_else(|| self.first_by_look(levels))
    }

    fn first_by_number(&self, levels: &LevelSplit) -> Option<u64> {
        let (first, last) = (levels.first.max(self.split.first), levels.last.min(self.split.last));
        (first <= last && self.game.tools().levels.family(&levels.mode) == self.family).then_some(first)
    }

    fn first_by_look(&self, levels: &LevelSplit) -> Option<u64> {
        if self.fingerprints.is_empty() {
            return None;
        }
        levels.levels().find(|&level| self.contains(&levels.mode, level))
    }

    /// Describes the levels of `seen` that are held out; `None` if there are no such levels, or if the seen levels
    /// are unknown.
    ///
    /// All levels of all ranges are compared by their numbers, and those of the first ranges by their looks.
    pub fn shown_by(&self, seen: Option<&SeenLevels>) -> Option<String> {
        let seen = seen.filter(|seen| seen.game == self.game.name())?;
        // Files are compared by their content: a pattern from an unknown source is not looked up on the disk.
        let ranges = seen.levels.iter().filter(|range| !is_level_files(range));
        let ranges = ranges.filter_map(|range| range.parse::<LevelSplit>().ok());
        // Ranges of a mode that the game no longer has are skipped.
        let known: Vec<_> = ranges.filter(|range| self.game.check_mode(&range.mode).is_ok()).collect();
        let by_number = || known.iter().find(|range| self.first_by_number(range).is_some());
        let by_look = || {
            let mut left = MOST_COMPARED;
            let mut near = known.iter().take_while(|range| {
                let is_near = range.len() <= left;
                left = left.saturating_sub(range.len());
                is_near
            });
            near.find(|range| self.first_by_look(range).is_some())
        };
        let shown = by_number().or_else(by_look).map(|range| range.to_string());
        let shown = shown.or_else(|| self.file_of(&seen.level_files))?;
        let is_all = seen.levels.len() + seen.level_files.len() == 1;
        Some(if is_all { shown } else { format!("{shown}, among others") })
    }

    /// Returns the first held-out file whose hash is among these.
    fn file_of(&self, hashes: &[u64]) -> Option<String> {
        if !hashes.iter().any(|hash| self.fingerprints.contains(hash)) {
            return None;
        }
        let mode = &self.split.mode;
        let is_shown = |level: &u64| {
            let fingerprint = self.game.fingerprint(mode, *level);
            fingerprint.is_some_and(|print| hashes.contains(&print))
        };
        self.split.levels().find(is_shown).map(|level| format!("{mode}:{level}"))
    }
}

/// Returns the levels that training on `train` shows. Files are noted by their present content.
pub fn seen_by_training(game: &dyn Game, train: &LevelSplit) -> SeenLevels {
    let game_name = game.name().to_owned();
    if is_level_files(&train.mode) {
        let level_files = train.levels().filter_map(|level| game.fingerprint(&train.mode, level)).collect();
        return SeenLevels { game: game_name, levels: Vec::new(), level_files };
    }
    SeenLevels { game: game_name, levels: vec![train.to_string()], level_files: Vec::new() }
}

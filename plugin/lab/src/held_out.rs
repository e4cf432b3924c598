//! Levels that are kept for the test, and whatever would give them away.

use std::collections::BTreeSet;

use bevy_playbot::level_files::LevelFile;
use playbot_learner::SeenLevels;

use crate::{game::Game, split::LevelSplit};

/// Held-out levels, as nobody may see them before the test: neither under the rules of another mode, nor where another seed
/// happens to draw the same places.
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
        Self { game, split, family: game.family(&split.mode), fingerprints }
    }

    /// The levels as they were named.
    pub fn split(&self) -> &LevelSplit {
        self.split
    }

    /// Whether this level is one of them, or looks like one.
    pub fn contains(&self, mode: &str, level: u64) -> bool {
        let is_named = self.split.contains(&self.split.mode, level) && self.game.family(mode) == self.family;
        is_named || self.game.fingerprint(mode, level).is_some_and(|print| self.fingerprints.contains(&print))
    }

    /// Whether one of them is the level in this file, whatever number it has.
    pub fn contains_file(&self, file: &LevelFile) -> bool {
        self.fingerprints.contains(&file.hash)
    }

    /// The first of these levels that is held out.
    pub fn first_of(&self, levels: &LevelSplit) -> Option<u64> {
        let (first, last) = (levels.first.max(self.split.first), levels.last.min(self.split.last));
        if first <= last && self.game.family(&levels.mode) == self.family {
            return Some(first);
        }
        if self.fingerprints.is_empty() {
            return None;
        }
        levels.levels().find(|&level| self.contains(&levels.mode, level))
    }

    /// What of `seen` is among them, in words; `None` if nothing is, or if nobody noted what was seen.
    pub fn shown_by(&self, seen: Option<&SeenLevels>) -> Option<String> {
        let seen = seen.filter(|seen| seen.game == self.game.name())?;
        // A mode that the game has no more has none of its levels.
        let ranges = seen.levels.iter().filter_map(|range| range.parse::<LevelSplit>().ok());
        let mut known = ranges.filter(|range| self.game.check_mode(&range.mode).is_ok());
        let shown = known.find(|range| self.first_of(range).is_some()).map(|range| range.to_string());
        let shown = shown.or_else(|| self.file_of(&seen.level_files))?;
        let is_all = seen.levels.len() + seen.level_files.len() == 1;
        Some(if is_all { shown } else { format!("{shown}, among others") })
    }

    /// The first of them that is one of these files.
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

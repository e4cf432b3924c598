//! Levels that are kept for the test, and whatever would give them away.

use std::collections::BTreeSet;

use bevy_playbot::level_files::LevelFile;
use playbot_learner::SeenLevels;

use crate::{game::Game, level_files::is_level_files, split::LevelSplit};

/// Most levels that a file can ask to be drawn and compared: what it says is not to take for ever.
const MOST_COMPARED: u64 = 1 << 18;

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
        self.first_by_number(levels).or_else(|| self.first_by_look(levels))
    }

    fn first_by_number(&self, levels: &LevelSplit) -> Option<u64> {
        let (first, last) = (levels.first.max(self.split.first), levels.last.min(self.split.last));
        (first <= last && self.game.family(&levels.mode) == self.family).then_some(first)
    }

    fn first_by_look(&self, levels: &LevelSplit) -> Option<u64> {
        if self.fingerprints.is_empty() {
            return None;
        }
        levels.levels().find(|&level| self.contains(&levels.mode, level))
    }

    /// What of `seen` is among them, in words; `None` if nothing is, or if nobody noted what was seen. Of the many levels that a file
    /// may name, all are compared by their numbers, and those of the first ranges by what they look like.
    pub fn shown_by(&self, seen: Option<&SeenLevels>) -> Option<String> {
        let seen = seen.filter(|seen| seen.game == self.game.name())?;
        // Files are noted by what is in them: a pattern from a stranger is not looked for on the disk.
        let ranges = seen.levels.iter().filter(|range| !is_level_files(range));
        let ranges = ranges.filter_map(|range| range.parse::<LevelSplit>().ok());
        // A mode that the game has no more has none of its levels.
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

/// What a training on these levels sees. Files are noted by what is in them now.
pub fn seen_by_training(game: &dyn Game, train: &LevelSplit) -> SeenLevels {
    let game_name = game.name().to_owned();
    if is_level_files(&train.mode) {
        let level_files = train.levels().filter_map(|level| game.fingerprint(&train.mode, level)).collect();
        return SeenLevels { game: game_name, levels: Vec::new(), level_files };
    }
    SeenLevels { game: game_name, levels: vec![train.to_string()], level_files: Vec::new() }
}

//! Levels that are kept for the test, and whatever would give them away.

use std::collections::BTreeSet;

use bevy_playbot::level_files::LevelFile;

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
        self.contains_hash(file.hash)
    }

    /// Whether one of them is the level in a file of this [hash](LevelFile::hash).
    pub fn contains_hash(&self, hash: u64) -> bool {
        self.fingerprints.contains(&hash)
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
}

//! Held-out levels, and levels of one layout under different numbers.
//!
//! Different seeds can draw the same level. A held-out level that is drawn again is no unseen level, whatever its number
//! is. [`HeldOut::contains`] is for levels that a training or a recording must not show: those of the range, by number
//! or as a file of the same content. [`HeldOut::seen_in`] is for levels that a result must leave out.

use crate::{
    game::{Game, level_designs},
    level_files::is_level_files,
    split::LevelSplit,
};
use bevy_playbot::level::LevelFile;
use playbot_learner::SeenLevels;
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::OnceLock,
};

/// Largest number of levels that are drawn and compared, which bounds the time for a range from a file.
const MOST_COMPARED: u64 = 1 << 18;

/// Largest number of training levels that the check of an experiment draws.
const MOST_CHECKED: u64 = 1 << 12;

/// Levels by the hash of their layout, each list in ascending order.
pub type LevelsByLayout = BTreeMap<u64, Vec<u64>>;

/// Returns the levels of a split by their layout. Levels without a [layout](Game::layout) are not among them.
pub fn by_layout(game: &dyn Game, split: &LevelSplit) -> LevelsByLayout {
    let mut layouts = LevelsByLayout::new();
    for level in split.levels() {
        if let Some(layout) = game.layout(&split.mode, level) {
            layouts.entry(layout).or_default().push(level);
        }
    }
    layouts
}

/// Held-out levels, kept unseen before the test, also under another mode's rules.
pub struct HeldOut<'a> {
    game: &'a dyn Game,
    split: &'a LevelSplit,
    family: String,
    /// Hashes of the files' contents, if the levels are files.
    files: BTreeSet<u64>,
    layouts: OnceLock<LevelsByLayout>,
}

impl<'a> HeldOut<'a> {
    /// Holds out a split of a game whose mode has been checked with [`Game::check_mode`].
    pub fn new(game: &'a dyn Game, split: &'a LevelSplit) -> Self {
        let family = game.tools().levels.family(&split.mode);
        let files = split.levels().map_while(|level| file_hash(game, &split.mode, level)).collect();
        Self { game, split, family, files, layouts: OnceLock::new() }
    }

    /// Returns the levels as they were named.
    pub fn split(&self) -> &LevelSplit {
        self.split
    }

    /// Returns whether this level is held out: by its number, or as a file of the same content.
    pub fn contains(&self, mode: &str, level: u64) -> bool {
        let is_named =
            self.split.contains(&self.split.mode, level) && self.game.tools().levels.family(mode) == self.family;
        is_named || file_hash(self.game, mode, level).is_some_and(|hash| self.files.contains(&hash))
    }

    /// Returns whether this level has the layout of a held-out one.
    pub fn resembles(&self, mode: &str, level: u64) -> bool {
        self.game.layout(mode, level).is_some_and(|layout| self.layouts().contains_key(&layout))
    }

    /// Returns whether the level in this file is held out, under any number.
    pub fn contains_file(&self, file: &LevelFile) -> bool {
        self.files.contains(&file.hash)
    }

    /// Returns the first of these levels that is held out.
    pub fn first_of(&self, levels: &LevelSplit) -> Option<u64> {
        let by_content = || levels.levels().find(|&level| self.contains(&levels.mode, level));
        self.first_by_number(levels).or_else(|| if is_level_files(&levels.mode) { by_content() } else { None })
    }

    fn first_by_number(&self, levels: &LevelSplit) -> Option<u64> {
        self.common(levels).map(|(first, _)| first)
    }

    /// Returns the first and the last number of both.
    fn common(&self, levels: &LevelSplit) -> Option<(u64, u64)> {
        let (first, last) = (levels.first.max(self.split.first), levels.last.min(self.split.last));
        (first <= last && self.game.tools().levels.family(&levels.mode) == self.family).then_some((first, last))
    }

    /// Describes the levels of `seen` that are held out; `None` if there are no such levels, or if the seen levels
    /// are unknown. Levels that only have the layout of a held-out one are not among them.
    pub fn shown_by(&self, seen: Option<&SeenLevels>) -> Option<String> {
        let seen = seen.filter(|seen| seen.game == self.game.name())?;
        let known = self.known_ranges(seen);
        let shown = known.iter().find(|range| self.first_by_number(range).is_some()).map(ToString::to_string);
        let shown = shown.or_else(|| self.file_of(&seen.level_files))?;
        let is_all = seen.levels.len() + seen.level_files.len() == 1;
        Some(if is_all { shown } else { format!("{shown}, among others") })
    }

    /// Returns the held-out levels that are seen: by number, as a file, or by their layout.
    ///
    /// All levels of all ranges are compared by their numbers, and those of the first ranges by their layouts, up to
    /// 262,144 levels.
    pub fn seen_in(&self, seen: &SeenLevels) -> BTreeSet<u64> {
        let mut found = BTreeSet::new();
        if seen.game != self.game.name() {
            return found;
        }
        let mut left = MOST_COMPARED;
        for range in self.known_ranges(seen) {
            if let Some((first, last)) = self.common(&range) {
                found.extend(first..=last);
            }
            if range.len() <= left && !self.layouts().is_empty() {
                left -= range.len();
                let layouts = range.levels().filter_map(|level| self.game.layout(&range.mode, level));
                self.add_layouts(layouts, &mut found);
            }
        }
        let is_file = |level: &u64| {
            let hash = file_hash(self.game, &self.split.mode, *level);
            hash.is_some_and(|hash| seen.level_files.contains(&hash))
        };
        if !seen.level_files.is_empty() && !self.files.is_empty() {
            found.extend(self.split.levels().filter(is_file));
        }
        self.add_layouts(seen.layouts.iter().copied(), &mut found);
        found
    }

    /// Returns true if every held-out level has the layout of one of these levels. More than 4,096 are not compared: this
    /// is for the check of an experiment, which takes no time.
    pub fn are_all_in(&self, levels: &LevelSplit) -> bool {
        if levels.len() > MOST_CHECKED {
            return false;
        }
        let layouts = by_layout(self.game, levels);
        let is_known = |level| self.game.layout(&self.split.mode, level).is_some_and(|it| layouts.contains_key(&it));
        !layouts.is_empty() && self.split.levels().all(is_known)
    }

    fn add_layouts(&self, layouts: impl Iterator<Item = u64>, found: &mut BTreeSet<u64>) {
        found.extend(layouts.filter_map(|layout| self.layouts().get(&layout)).flatten());
    }

    fn layouts(&self) -> &LevelsByLayout {
        self.layouts.get_or_init(|| by_layout(self.game, self.split))
    }

    /// Returns the ranges of seen levels that the game still has. Files are compared by their content: a pattern from
    /// an unknown source is not looked up on the disk.
    fn known_ranges(&self, seen: &SeenLevels) -> Vec<LevelSplit> {
        let ranges = seen.levels.iter().filter(|range| !is_level_files(range));
        let ranges = ranges.filter_map(|range| range.parse::<LevelSplit>().ok());
        ranges.filter(|range| self.game.check_mode(&range.mode).is_ok()).collect()
    }

    /// Returns the first held-out file whose hash is among these.
    fn file_of(&self, hashes: &[u64]) -> Option<String> {
        if !hashes.iter().any(|hash| self.files.contains(hash)) {
            return None;
        }
        let mode = &self.split.mode;
        let is_shown = |level: &u64| file_hash(self.game, mode, *level).is_some_and(|hash| hashes.contains(&hash));
        self.split.levels().find(is_shown).map(|level| format!("{mode}:{level}"))
    }
}

/// Returns the hash of a level file's content; `None` for levels that the game draws itself.
fn file_hash(game: &dyn Game, mode: &str, level: u64) -> Option<u64> {
    if is_level_files(mode) { level_designs(game, mode).ok()?.hash(level) } else { None }
}

/// Returns the levels that training on `train` shows. Files are noted by their present content.
pub fn seen_by_training(game: &dyn Game, train: &LevelSplit) -> SeenLevels {
    let game_name = game.name().to_owned();
    if is_level_files(&train.mode) {
        let level_files = train.levels().filter_map(|level| file_hash(game, &train.mode, level)).collect();
        let layouts = by_layout(game, train).into_keys().collect();
        return SeenLevels { game: game_name, levels: Vec::new(), level_files, layouts };
    }
    SeenLevels { game: game_name, levels: vec![train.to_string()], ..SeenLevels::default() }
}

//! Held-out levels, and levels of one layout under different numbers.
//!
//! Different seeds can draw the same level. A held-out level that is drawn again is no unseen level, whatever its number
//! is. [`HeldOut::contains`] is for levels that a training or a recording must not show: those of the range, by number
//! or as a file of the same content. [`HeldOut::seen_in`] is for levels that a result must leave out.
//!
//! A game that does not hash the layouts of its levels has them compared by their play: [`AlikeLevels`].

use crate::{
    game::{Game, level_designs},
    level_files::is_level_files,
    machine::usable_threads,
    parallel::{default_threads, on_threads},
    split::{LevelSplit, last_level},
    worlds::{EndedEpisodes, build_world, hash_with_agent},
};
use bevy::prelude::*;
use bevy_playbot::{
    agent::Control,
    bot::BlindBot,
    engine::{EpisodeSeeds, panics::PanicReports, tick_world},
    episode::{Episode, EpisodeEnd, EpisodeResult},
    level::{LevelFile, LevelQueue},
    observation::Observation,
    reward::Reward,
    state_hash::StateHash,
};
use playbot_learner::SeenLevels;
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::OnceLock,
};

/// Largest number of levels that are drawn and compared, which bounds the time for a range from a file.
const MOST_COMPARED: u64 = 1 << 18;

/// Largest number of training levels that the check of an experiment draws.
const MOST_CHECKED: u64 = 1 << 12;

/// Largest number of levels whose layouts a result counts, so that counting takes no time beside playing.
const MOST_COUNTED: u64 = 1 << 16;

/// Levels by the hash of their layout, each list in ascending order.
pub type LevelsByLayout = BTreeMap<u64, Vec<u64>>;

/// Returns the levels of a split by their layout. Levels without a [layout](Game::layout) are not among them.
pub fn by_layout(game: &dyn Game, split: &LevelSplit) -> LevelsByLayout {
    by_layout_until(game, split, &|| false).0
}

/// Returns the levels of a split by their layout until the caller stops, and the number of levels that were looked at, the
/// first ones.
pub(crate) fn by_layout_until(
    game: &dyn Game,
    split: &LevelSplit,
    stop: &(dyn Fn() -> bool + Sync),
) -> (LevelsByLayout, u64) {
    let (mut layouts, mut count) = (LevelsByLayout::new(), 0);
    for level in split.levels() {
        // Whether the game has layouts is known from one on.
        if count > 0 && stop() {
            break;
        }
        count += 1;
        if let Some(layout) = game.layout(&split.mode, level) {
            layouts.entry(layout).or_default().push(level);
        }
    }
    (layouts, count)
}

/// Returns true if a game has one level of its own, which it is trained and measured on.
pub fn is_only_level(game: &dyn Game, mode: &str) -> bool {
    last_level(game, mode) == Some(0)
}

/// Levels that players are measured on, and those of them that the players know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnownLevels {
    /// Known levels that are left out.
    pub left_out: BTreeSet<u64>,
    /// The number of known levels that are measured with the others.
    pub seen: u64,
    /// Different layouts of the measured levels, as [`HeldOut::different`] counts them.
    pub layouts: Option<u64>,
}

/// Held-out levels, kept unseen before the test, also under another mode's rules.
pub struct HeldOut<'a> {
    game: &'a dyn Game,
    split: &'a LevelSplit,
    family: String,
    /// Hashes of the files' contents, if the levels are files.
    files: BTreeSet<u64>,
    layouts: OnceLock<LevelsByLayout>,
    /// False if the game has a single level: it is trained and measured on that one, so nothing is held out.
    holds: bool,
}

impl<'a> HeldOut<'a> {
    /// Holds out a split of a game whose mode has been checked with [`Game::check_mode`].
    /// A game with a [single level](is_only_level) holds nothing out.
    pub fn new(game: &'a dyn Game, split: &'a LevelSplit) -> Self {
        Self { holds: !is_only_level(game, &split.mode), ..Self::levels_of(game, split) }
    }

    /// Takes a split to look levels up in, whether or not they can be held out, with the layouts of the levels that come
    /// before the caller stops.
    pub fn levels_until(game: &'a dyn Game, split: &'a LevelSplit, stop: &(dyn Fn() -> bool + Sync)) -> Self {
        let (layouts, _) = by_layout_until(game, split, stop);
        Self { layouts: layouts.into(), ..Self::levels_of(game, split) }
    }

    /// Takes a split to look levels up in, whether or not they can be held out.
    pub fn levels_of(game: &'a dyn Game, split: &'a LevelSplit) -> Self {
        let family = game.tools().levels.family(&split.mode);
        let files = split.levels().map_while(|level| file_hash(game, &split.mode, level)).collect();
        Self { game, split, family, files, layouts: OnceLock::new(), holds: true }
    }

    /// Returns the levels as they were named.
    pub fn split(&self) -> &LevelSplit {
        self.split
    }

    /// Returns whether this level is held out: by its number, or as a file of the same content.
    pub fn contains(&self, mode: &str, level: u64) -> bool {
        let is_named =
            self.split.contains(&self.split.mode, level) && self.game.tools().levels.family(mode) == self.family;
        self.holds && is_named || file_hash(self.game, mode, level).is_some_and(|hash| self.files.contains(&hash))
    }

    /// Returns whether this level has the layout of a held-out one.
    pub fn resembles(&self, mode: &str, level: u64) -> bool {
        self.holds && self.game.layout(mode, level).is_some_and(|layout| self.layouts().contains_key(&layout))
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
        let is_same_family = || self.game.tools().levels.family(&levels.mode) == self.family;
        (self.holds && first <= last && is_same_family()).then_some((first, last))
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

    /// Returns the number of different layouts among the levels that are not left out. `None` if the game does not hash
    /// the layout of each, or if there are more than 65,536 levels.
    pub fn different(&self, left_out: &BTreeSet<u64>) -> Option<u64> {
        if self.split.len() > MOST_COUNTED {
            return None;
        }
        let (layouts, hashed) = (self.layouts(), self.layouts().values().map(Vec::len).sum::<usize>());
        let is_whole = hashed > 0 && hashed as u64 == self.split.len();
        let is_played = |levels: &&Vec<u64>| levels.iter().any(|level| !left_out.contains(level));
        is_whole.then(|| layouts.values().filter(is_played).count() as u64)
    }

    /// Leaves out the levels that players know, or keeps them all.
    pub fn without(&self, known: BTreeSet<u64>, keeps_all: bool) -> KnownLevels {
        let (left_out, seen) = if keeps_all { (BTreeSet::new(), known.len() as u64) } else { (known, 0) };
        KnownLevels { layouts: self.different(&left_out), left_out, seen }
    }

    /// Returns the held-out levels that are seen: by number, as a file, or by their layout.
    ///
    /// All levels of all ranges are compared by their numbers, and those of the first ranges by their layouts, up to
    /// 262,144 levels. A larger range is named in a warning. If the game has no layouts and [compares
    /// states](crate::game::StateTools::compares_levels), the first ranges are compared by their play, up to 128 levels
    /// with the held-out ones. If all held-out levels play like seen ones, none is left out for that: the game has no
    /// others. `progress` is that of [`AlikeLevels::of`], and is called only if levels are played.
    pub fn seen_in(&self, seen: &SeenLevels, progress: &(dyn Fn(u64, u64) + Sync)) -> BTreeSet<u64> {
        let mut found = BTreeSet::new();
        if seen.game != self.game.name() || !self.holds {
            return found;
        }
        let (ranges, mut left) = (self.known_ranges(seen), MOST_COMPARED);
        for range in &ranges {
            if let Some((first, last)) = self.common(range) {
                found.extend(first..=last);
            }
            if self.layouts().is_empty() {
                continue;
            }
            if range.len() > left {
                tracing::warn!(
                    "{range} are too many levels to compare with {} by their layouts: some of these may be no unseen levels",
                    self.split
                );
                continue;
            }
            left -= range.len();
            let layouts = range.levels().filter_map(|level| self.game.layout(&range.mode, level));
            self.add_layouts(layouts, &mut found);
        }
        let is_file = |level: &u64| {
            let hash = file_hash(self.game, &self.split.mode, *level);
            hash.is_some_and(|hash| seen.level_files.contains(&hash))
        };
        if !seen.level_files.is_empty() && !self.files.is_empty() {
            found.extend(self.split.levels().filter(is_file));
        }
        self.add_layouts(seen.layouts.iter().copied(), &mut found);
        let is_unknown = self.layouts().is_empty() && !is_level_files(&self.split.mode);
        if is_unknown && self.game.tools().state.compares_levels() {
            self.add_alike(&ranges, &mut found, progress);
        }
        found
    }

    /// Adds the levels that play like seen ones to those that are found already.
    fn add_alike(&self, seen: &[LevelSplit], found: &mut BTreeSet<u64>, progress: &(dyn Fn(u64, u64) + Sync)) {
        let too_many = |range: &LevelSplit| {
            tracing::warn!(
                "{range} are too many levels to play for a comparison with {}: some of these may be no unseen levels; give `{}` \
                 a `.layout`",
                self.split,
                self.game.name()
            );
        };
        let mut left = MOST_PLAYED.saturating_sub(self.split.len());
        let mut by_mode = BTreeMap::<&str, BTreeSet<u64>>::new();
        for range in seen {
            if range.len() <= left {
                left -= range.len();
                by_mode.entry(&range.mode).or_default().extend(range.levels());
            } else {
                too_many(range);
            }
        }
        let own: Vec<u64> = self.split.levels().filter(|level| !found.contains(level)).collect();
        if own.is_empty() || by_mode.is_empty() {
            return;
        }
        let others = by_mode.into_iter().map(|(mode, levels)| (mode, levels.into_iter().collect()));
        let ranges: Vec<(&str, Vec<u64>)> = [(self.split.mode.as_str(), own)].into_iter().chain(others).collect();
        let is_wanted = |group: &[PlacedLevel]| group.iter().any(is_own) && !group.iter().all(is_own);
        let threads = usable_threads(default_threads());
        let alike = AlikeLevels::of(self.game, &ranges, is_wanted, threads, progress, &|| false);
        if !alike.by_state {
            return;
        }
        let known: BTreeSet<u64> = (1..ranges.len()).flat_map(|range| alike.among(range)).collect();
        if known.len() == ranges[0].1.len() {
            tracing::warn!(
                "each of the levels {} plays like one that was seen, as far as the state of `{}` shows: none is left out for \
                 that, and they are no unseen levels",
                self.split,
                self.game.name()
            );
            return;
        }
        found.extend(known);
    }

    /// Returns true if every held-out level has the layout of one of these levels. More than 4,096 are not compared: this
    /// is for the check of an experiment, which takes no time.
    pub fn are_all_in(&self, levels: &LevelSplit) -> bool {
        if levels.len() > MOST_CHECKED || !self.holds {
            return false;
        }
        let layouts = by_layout(self.game, levels);
        let is_known = |level| self.game.layout(&self.split.mode, level).is_some_and(|it| layouts.contains_key(&it));
        !layouts.is_empty() && self.split.levels().all(is_known)
    }

    fn add_layouts(&self, layouts: impl Iterator<Item = u64>, found: &mut BTreeSet<u64>) {
        found.extend(layouts.filter_map(|layout| self.layouts().get(&layout)).flatten());
    }

    /// Returns the levels by their layout.
    pub fn layouts(&self) -> &LevelsByLayout {
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

// Levels that play alike.

/// Ticks after which levels that have played alike so far are compared again, ascending.
const STAGES: [u32; 3] = [1, 60, 600];

/// Levels for each World that plays them, if there are enough.
const LEVELS_PER_WORLD: usize = 32;

/// Largest number of Worlds that play levels. It is the same on any number of threads, and so are results.
const MOST_WORLDS: usize = 8;

/// Worlds in a row that break in their first level, after which the other levels of a thread are not played.
const MOST_BARREN: u32 = 3;

/// Largest number of levels that are played to compare held-out levels with seen ones. A slow game plays a few in a
/// second, and `eval` may not wait for minutes; `playbot levels` compares as many as are asked for.
const MOST_PLAYED: u64 = 128;

/// A level of one of several ranges: the index of the range, and the number of the level.
pub type PlacedLevel = (usize, u64);

/// Returns whether a level is of the first range.
fn is_own((range, _): &PlacedLevel) -> bool {
    *range == 0
}

/// Levels by how they play, for games that do not hash their layouts.
///
/// Levels are alike if their episodes are the same for the same actions, drawn at random, for 600 ticks or to their end:
/// in observations, rewards, ends, and in all that is known of the state
/// ([`known_state`](crate::game::StateTools::known_state)). Their first tick tells most levels apart, and only those
/// that are alike in it are played on. Levels that differ in anything which neither is seen nor shows within these ticks
/// count as alike.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AlikeLevels {
    /// All levels that could be played, in groups that are alike, in the order of their first levels.
    classes: Vec<Vec<PlacedLevel>>,
    /// True if the state of the game was compared in all ticks. Otherwise levels are alike by what agents observe, and
    /// may differ in the rest.
    pub by_state: bool,
    /// Levels of the first range that are in no group, since the caller stopped before they were told apart.
    pub unfinished: u64,
}

impl AlikeLevels {
    /// The most ticks of a level that are played.
    pub const TICKS: u32 = STAGES[STAGES.len() - 1];

    /// Plays levels of some modes, all of which the game has. Groups that are not wanted are not told apart any further.
    /// `progress` receives episodes that have been played, and those that are to be played besides the ones that it has
    /// received before, from several threads. A level that is played on has a second and a third episode. If the caller
    /// stops, groups are those of the levels whose comparison was over by then.
    pub fn of(
        game: &dyn Game,
        ranges: &[(&str, Vec<u64>)],
        is_wanted: impl Fn(&[PlacedLevel]) -> bool,
        threads: usize,
        progress: impl Fn(u64, u64) + Sync,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Self {
        let placed = |(range, (_, levels)): (usize, &(&str, Vec<u64>))| -> Vec<PlacedLevel> {
            levels.iter().map(|&level| (range, level)).collect()
        };
        let all: BTreeSet<PlacedLevel> = ranges.iter().enumerate().flat_map(placed).collect();
        if game.problem().is_some() || all.is_empty() {
            return Self::default();
        }
        let mut open = vec![all.into_iter().collect::<Vec<_>>()];
        let (mut classes, mut by_state, mut unfinished) = (Vec::new(), true, 0);
        for ticks in STAGES {
            progress(0, open.iter().map(|group| group.len() as u64).sum());
            let mut played = BTreeMap::new();
            for (range, (mode, _)) in ranges.iter().enumerate() {
                let waiting = open.iter().flatten().filter(|(of, _)| *of == range).map(|(_, level)| *level);
                let mut waiting: Vec<u64> = waiting.collect();
                // Groups stand in the order of their hashes, which can differ from build to build. Levels are dealt to
                // Worlds in their own order.
                waiting.sort_unstable();
                let results = play(game, mode, &waiting, ticks, threads, &|played| progress(played, 0), stop);
                played.extend(results.into_iter().map(|result| ((range, result.level), result)));
            }
            let (mut left, is_stopped) = (Vec::new(), stop());
            for group in open {
                let mut alike = BTreeMap::<u64, Vec<PlacedLevel>>::new();
                let mut over = BTreeSet::new();
                for level in group {
                    let Some(PlayedLevel { hash, is_over, is_state, .. }) = played.get(&level) else {
                        // A level that breaks the game is like no other.
                        unfinished += u64::from(is_stopped && is_own(&level));
                        continue;
                    };
                    alike.entry(*hash).or_default().push(level);
                    by_state &= is_state;
                    over.extend(is_over.then_some(*hash));
                }
                for (hash, group) in alike {
                    let goes_on = group.len() > 1 && is_wanted(&group) && !over.contains(&hash);
                    if !goes_on {
                        classes.push(group);
                    } else if is_stopped && ticks < Self::TICKS {
                        unfinished += group.iter().filter(|level| is_own(level)).count() as u64;
                    } else {
                        left.push(group);
                    }
                }
            }
            open = left;
            if open.is_empty() || is_stopped {
                break;
            }
        }
        classes.extend(open);
        classes.sort_unstable();
        Self { by_state: by_state && !classes.is_empty(), classes, unfinished }
    }

    /// Returns the groups of levels of the first range that are alike, each in ascending order. Levels that are like no
    /// other are groups of one.
    pub fn groups(&self) -> Vec<Vec<u64>> {
        let own =
            |class: &Vec<PlacedLevel>| class.iter().filter(|level| is_own(level)).map(|(_, level)| *level).collect();
        self.classes.iter().map(own).filter(|group: &Vec<u64>| !group.is_empty()).collect()
    }

    /// Returns the levels of the first range that are like one of another range.
    pub fn among(&self, range: usize) -> BTreeSet<u64> {
        let has = |class: &&Vec<PlacedLevel>| class.iter().any(|(of, _)| *of == range);
        let own = self.classes.iter().filter(has).flatten().filter(|level| is_own(level));
        own.map(|(_, level)| *level).collect()
    }
}

/// The play of a level.
struct PlayedLevel {
    level: u64,
    /// Hash of all that was seen of it.
    hash: u64,
    /// True if the state was known in every tick.
    is_state: bool,
    /// True if the episode has ended.
    is_over: bool,
}

/// Plays so many ticks of each level with the same random actions. Levels that break the game are missing, and so are those
/// that were not played to the end when the caller stopped.
fn play(
    game: &dyn Game,
    mode: &str,
    levels: &[u64],
    ticks: u32,
    threads: usize,
    progress: &(impl Fn(u64) + Sync),
    stop: &(dyn Fn() -> bool + Sync),
) -> Vec<PlayedLevel> {
    let worlds = levels.len().div_ceil(LEVELS_PER_WORLD).clamp(1, MOST_WORLDS);
    let mut shares: Vec<&[u64]> = levels.chunks(levels.len().div_ceil(worlds).max(1)).collect();
    let parts = on_threads(&mut shares, threads, |share| -> Vec<PlayedLevel> {
        let (mut played, mut left, mut barren) = (Vec::new(), *share, 0);
        // A broken World is built again for the levels behind the one that broke it, unless it breaks each time.
        while !left.is_empty() && barren < MOST_BARREN && !stop() {
            let part = play_world(game, mode, left, ticks, progress, stop);
            left = left.get(part.len() + 1..).unwrap_or_default();
            barren = if part.is_empty() { barren + 1 } else { 0 };
            played.extend(part);
        }
        played
    });
    parts.into_iter().flatten().collect()
}

/// Plays levels in one World, until one of them breaks it or the caller stops.
fn play_world(
    game: &dyn Game,
    mode: &str,
    levels: &[u64],
    ticks: u32,
    progress: &(impl Fn(u64) + Sync),
    stop: &(dyn Fn() -> bool + Sync),
) -> Vec<PlayedLevel> {
    let (mut world, agents) = build_world(game, mode, 0, 0, 1);
    let Some(&agent) = agents.first() else { return Vec::new() };
    if let Some(mut reports) = world.get_resource_mut::<PanicReports>() {
        reports.keep_no_files();
    }
    EndedEpisodes::note_in(&mut world);
    // Some games begin their first episode in a World otherwise than the next ones.
    let queue: Vec<u64> = levels.first().into_iter().chain(levels).copied().collect();
    let seeds = EpisodeSeeds::new(vec![0; queue.len()]);
    world.entity_mut(agent).insert((Control::Bot, BlindBot::Chaos, LevelQueue::list(queue), seeds));
    let mut played = Vec::with_capacity(levels.len() + 1);
    let begun = |level| PlayedLevel { level, hash: 0, is_state: true, is_over: false };
    let mut now: Option<PlayedLevel> = None;
    while Control::of(&world, agent).is_active() && !stop() {
        if tick_world(&mut world).is_err() {
            break;
        }
        let end = EndedEpisodes::take(&mut world).into_iter().find(|(ended, _)| *ended == agent);
        let end: Option<EpisodeResult> = end.map(|(_, result)| result);
        let Some(episode) = world.get::<Episode>(agent) else { break };
        if end.is_none() && !episode.is_running() {
            continue;
        }
        let (level, tick) = end.map_or((episode.level, episode.tick), |result| (result.level, result.ticks));
        let level = now.get_or_insert_with(|| begun(level));
        let state = game.tools().state.known_state(&world, agent);
        let seen = hash_with_agent(state.unwrap_or(0), world.get::<Observation>(agent), world.get::<Reward>(agent));
        level.hash = StateHash::of([level.hash, seen, code(end)]).0;
        level.is_state &= state.is_some();
        level.is_over = end.is_some();
        if end.is_some() || tick >= ticks {
            // The first episode of a World is left out below.
            if !played.is_empty() {
                progress(1);
            }
            played.extend(now.take());
            if let (None, Some(mut episode)) = (end, world.get_mut::<Episode>(agent)) {
                episode.abandon();
            }
        }
    }
    played.into_iter().skip(1).collect()
}

/// Returns a number for the end of an episode in a tick.
fn code(end: Option<EpisodeResult>) -> u64 {
    match end {
        None => 0,
        Some(EpisodeResult { end: EpisodeEnd::Truncated, success, .. }) => 1 + u64::from(success),
        Some(EpisodeResult { success, .. }) => 3 + u64::from(success),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreign::{ForeignGame, LevelSeed, Restart};
    use std::sync::atomic::{AtomicU64, Ordering};

    #[derive(Component)]
    struct Dot;

    /// The speed of the dot from its 30th frame on. It is not reflected, and no agent observes it.
    #[derive(Resource, Default)]
    struct Drift {
        speed: f32,
        frames: u32,
    }

    /// A game with a dot at a place, which later drifts away.
    fn dots(place: fn(u64) -> f32, speed: fn(u64) -> f32) -> ForeignGame {
        let add = |app: &mut App| {
            app.init_resource::<Drift>()
                .add_systems(Startup, |mut commands: Commands| {
                    commands.spawn((Dot, Transform::default()));
                })
                .add_systems(Update, |mut drift: ResMut<Drift>, mut dot: Single<&mut Transform, With<Dot>>| {
                    drift.frames += 1;
                    if drift.frames > 30 {
                        dot.translation.x += drift.speed;
                    }
                });
        };
        ForeignGame::new("dots", 1, add)
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["nothing"], || [0.0])
            .time_limit(40)
            .restart(Restart::Startup)
            .level(
                move |level: Res<LevelSeed>, mut dot: Single<&mut Transform, With<Dot>>, mut drift: ResMut<Drift>| {
                    dot.translation.x = place(level.0);
                    *drift = Drift { speed: speed(level.0), frames: 0 };
                },
            )
    }

    fn modulo(level: u64, count: u64) -> f32 {
        (level % count) as f32
    }

    fn alike(game: &ForeignGame, levels: u64, is_wanted: bool, threads: usize) -> AlikeLevels {
        AlikeLevels::of(game, &[("default", (0..levels).collect())], |_| is_wanted, threads, |_, _| {}, &|| false)
    }

    #[test]
    fn levels_with_the_same_entities_are_alike_on_any_number_of_threads() {
        let game = dots(|level| modulo(level, 3), |_| 0.0);
        let found = alike(&game, 40, true, 1);
        let group = |first: u64| (first..40).step_by(3).collect::<Vec<_>>();
        assert_eq!((found.groups(), found.by_state), ([0, 1, 2].map(group).to_vec(), true));
        assert_eq!(alike(&game, 40, true, 2), found);
    }

    #[test]
    fn levels_that_differ_later_only_are_told_apart_by_their_play() {
        let game = dots(|_| 0.0, |level| modulo(level, 2));
        assert_eq!(alike(&game, 6, false, 1).groups(), [[0, 1, 2, 3, 4, 5]], "their first ticks are equal");
        assert_eq!(alike(&game, 6, true, 1).groups(), [[0, 2, 4], [1, 3, 5]]);
    }

    #[test]
    fn a_game_without_places_is_compared_by_what_agents_observe() {
        let game = |seen: f32| {
            ForeignGame::new("cards", 1, |_: &mut App| {})
                .keys([vec![], vec![KeyCode::Space]])
                .observe(["card"], move |level: Res<LevelSeed>| [seen * modulo(level.0, 2)])
                .time_limit(3)
        };
        let (blind, seeing) = (alike(&game(0.0), 4, true, 1), alike(&game(1.0), 4, true, 1));
        assert_eq!((blind.groups(), blind.by_state), (vec![vec![0, 1, 2, 3]], false));
        assert_eq!((seeing.groups(), seeing.by_state), (vec![vec![0, 2], vec![1, 3]], false));
        let hashed = alike(&game(0.0).state_hash(|level: Res<LevelSeed>| 1 + level.0 / 2), 4, true, 1);
        assert_eq!((hashed.groups(), hashed.by_state), (vec![vec![0, 1], vec![2, 3]], true));
    }

    /// Returns the levels 100 to 105 that are known to a player that has seen these levels.
    fn known(game: &ForeignGame, levels: &str) -> Vec<u64> {
        let split = "default:100..105".parse().expect("levels");
        let seen = SeenLevels { game: "dots".to_owned(), levels: vec![levels.to_owned()], ..SeenLevels::default() };
        HeldOut::new(game, &split).seen_in(&seen, &|_, _| {}).into_iter().collect()
    }

    #[test]
    fn held_out_levels_that_play_like_seen_ones_are_known_unless_all_do() {
        let game = dots(|level| modulo(level, 3), |_| 0.0);
        // 100 is like 1, and 102 like 0.
        assert_eq!(known(&game, "default:0..1"), [100, 102, 103, 105]);
        assert_eq!(known(&game, "default:0..2"), Vec::<u64>::new(), "the game has no other levels");
        assert_eq!(known(&game, "default:105..105"), [102, 105], "one of them by its number");
        assert_eq!(known(&game, "default:1000..6000"), Vec::<u64>::new(), "that would take long");
        let layouts = game.layout(|_, level| level);
        assert_eq!(known(&layouts, "default:0..1"), Vec::<u64>::new(), "its layouts say more");
    }

    #[test]
    fn layouts_that_are_not_left_out_are_counted_once() {
        let (game, split) = (dots(|_| 0.0, |_| 0.0), "default:0..9".parse().expect("levels"));
        let different = |game: &ForeignGame, left_out: &[u64]| {
            HeldOut::new(game, &split).different(&left_out.iter().copied().collect())
        };
        assert_eq!(different(&game, &[]), None, "it has no layouts");
        // 0, 4 and 8 are equal, and so are 3 and 7.
        let layouts = game.layout(|_, level| level % 4);
        assert_eq!(different(&layouts, &[]), Some(4));
        assert_eq!(different(&layouts, &[0, 4, 3]), Some(4), "8 and 7 are left");
        assert_eq!(different(&layouts, &[0, 4, 8, 3]), Some(3));
        let many = "default:0..65536".parse().expect("levels");
        assert_eq!(HeldOut::new(&layouts, &many).different(&BTreeSet::new()), None, "that would take long");
    }

    #[test]
    fn a_game_holds_out_levels_unless_it_has_only_one() {
        let split: LevelSplit = "default:0".parse().expect("a level");
        let seen =
            SeenLevels { game: "dots".to_owned(), levels: vec!["default:0..0".to_owned()], ..SeenLevels::default() };
        for (count, is_held_out) in [(1, false), (2, true)] {
            let game = dots(|_| 0.0, |_| 0.0).levels(count).layout(|_, _| 7);
            let held_out = HeldOut::new(&game, &split);
            assert_eq!(held_out.contains("default", 0), is_held_out);
            assert_eq!(held_out.resembles("default", 0), is_held_out);
            assert_eq!(held_out.first_of(&split).is_some(), is_held_out);
            assert_eq!(held_out.shown_by(Some(&seen)).is_some(), is_held_out);
            assert_eq!(!held_out.seen_in(&seen, &|_, _| {}).is_empty(), is_held_out);
            assert_eq!(held_out.are_all_in(&split), is_held_out);
            assert!(HeldOut::levels_of(&game, &split).contains("default", 0), "an audit looks levels up");
        }
    }

    #[test]
    fn what_is_observed_alone_leaves_no_level_out() {
        let blind = ForeignGame::new("dots", 1, |_: &mut App| {})
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["card"], |level: Res<LevelSeed>| [modulo(level.0, 3)])
            .time_limit(3);
        assert_eq!(known(&blind, "default:0..1"), Vec::<u64>::new());
    }

    #[test]
    fn a_level_that_breaks_the_game_is_like_no_other() {
        let game = dots(|level| modulo(level, 2), |_| 0.0)
            .reward(|level: Res<LevelSeed>| if level.0 == 2 { f32::NAN } else { 0.0 });
        assert_eq!(alike(&game, 6, true, 1).groups(), [vec![0, 4], vec![1, 3, 5]]);
    }

    #[test]
    fn levels_behind_many_that_break_the_game_are_played() {
        // Each World breaks in the first of two such levels, and the next World in the second.
        let game = dots(|_| 0.0, |_| 0.0).reward(|level: Res<LevelSeed>| if level.0 % 4 >= 2 { f32::NAN } else { 0.0 });
        assert_eq!(alike(&game, 18, true, 1).groups(), [[0, 1, 4, 5, 8, 9, 12, 13, 16, 17]]);
    }

    #[test]
    fn progress_counts_each_episode_that_is_played_once() {
        let game = dots(|level| modulo(level, 3), |_| 0.0);
        let (done, all) = (AtomicU64::new(0), AtomicU64::new(0));
        let progress = |played, more| {
            done.fetch_add(played, Ordering::Relaxed);
            all.fetch_add(more, Ordering::Relaxed);
            assert!(done.load(Ordering::Relaxed) <= all.load(Ordering::Relaxed), "no more than there are");
        };
        // All but level 2 have their like after the first tick. Episodes end after 40 ticks, and are not played on then.
        AlikeLevels::of(&game, &[("default", (0..5).collect())], |_| true, 1, progress, &|| false);
        assert_eq!((done.into_inner(), all.into_inner()), (5 + 4, 5 + 4));
    }

    #[test]
    fn a_stopped_comparison_has_the_groups_of_the_levels_that_were_played_to_the_end() {
        let game = dots(|level| modulo(level, 3), |_| 0.0);
        let stopped_after = |episodes: u64| {
            let done = AtomicU64::new(0);
            let progress = |played, _| {
                done.fetch_add(played, Ordering::Relaxed);
            };
            let stop = || done.load(Ordering::Relaxed) >= episodes;
            AlikeLevels::of(&game, &[("default", (0..40).collect())], |_| true, 1, progress, &stop)
        };
        // All levels have their like after one tick, and end within the 60 ticks of the second stage.
        let second = stopped_after(40 + 10);
        assert_eq!(second.groups(), [vec![0, 3, 6, 9], vec![1, 4, 7], vec![2, 5, 8]]);
        assert_eq!((second.unfinished, second.by_state), (30, true));
        let first = stopped_after(10);
        assert_eq!((first.groups(), first.unfinished), (Vec::<Vec<u64>>::new(), 40), "they may differ later");
    }
}

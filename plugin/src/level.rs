//! Queues of the levels that agents play, the files of levels, and what levels draw.
//!
//! ```
//! use bevy_playbot::{prelude::*, streams::AgentStreams};
//!
//! /// A rule of the game: every second level.
//! #[derive(Clone, Debug)]
//! struct Even(u64);
//!
//! impl LevelSource for Even {
//!     fn next_level(&mut self) -> Option<u64> {
//!         self.0 += 2;
//!         Some(self.0)
//!     }
//!
//!     fn clone_box(&self) -> Box<dyn LevelSource> {
//!         Box::new(self.clone())
//!     }
//! }
//!
//! let mut random = AgentStreams::new(1, 0).level;
//! let mut three_of = |mut queue: LevelQueue| [0; 3].map(|_| queue.next_level(&mut random));
//! assert_eq!(three_of(LevelQueue::list([3, 5])), [Some(3), Some(5), None]);
//! assert_eq!(three_of(LevelQueue::rounds([3, 5])), [Some(3), Some(5), Some(3)]);
//! assert_eq!(three_of(LevelQueue::Custom(Box::new(Even(0)))), [Some(2), Some(4), Some(6)]);
//! ```

use crate::carry_over::ReflectCarryComponent;
use bevy::prelude::*;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use std::{fmt, sync::Arc};

/// Source of level numbers for one agent.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, CarryComponent, Clone, Debug)]
pub enum LevelQueue {
    /// The same level forever.
    Always(u64),
    /// These levels, each once, in order. The agent idles afterwards.
    List {
        /// The levels; `levels[next..]` remain to be played.
        levels: Arc<[u64]>,
        /// Index of the next level.
        next: usize,
    },
    /// These levels over and over, in order. At least one.
    Rounds {
        /// The levels.
        levels: Arc<[u64]>,
        /// Index of the next level.
        next: usize,
    },
    /// Levels `first..=last`, uniformly and with replacement, from the agent's own random stream.
    Uniform {
        /// Lowest level.
        first: u64,
        /// Highest level, included.
        last: u64,
    },
    /// Levels with a share each, and new ones, from the agent's own random stream.
    Weighted(Arc<WeightedLevels>),
    /// A rule of the game.
    Custom(Box<dyn LevelSource>),
}

impl Default for LevelQueue {
    fn default() -> Self {
        Self::Always(0)
    }
}

impl LevelQueue {
    /// Creates a queue over a list of levels, each played once.
    pub fn list(levels: impl Into<Arc<[u64]>>) -> Self {
        Self::List { levels: levels.into(), next: 0 }
    }

    /// Creates a queue that goes through a list of levels again and again.
    pub fn rounds(levels: impl Into<Arc<[u64]>>) -> Self {
        Self::Rounds { levels: levels.into(), next: 0 }
    }

    /// Returns the next level, or `None` when no level is left.
    pub fn next_level(&mut self, rng: &mut impl Rng) -> Option<u64> {
        match self {
            Self::Always(level) => Some(*level),
            Self::List { levels, next } => {
                let level = levels.get(*next).copied();
                *next += usize::from(level.is_some());
                level
            }
            Self::Rounds { levels, next } => {
                let level = levels.get(*next).copied();
                *next = (*next + 1) % levels.len().max(1);
                level
            }
            Self::Uniform { first, last } => Some(rng.random_range(*first..=*last)),
            Self::Weighted(levels) => Some(levels.draw(rng)),
            Self::Custom(source) => source.next_level(),
        }
    }
}

/// Levels of a range that are drawn again by their weights, and the others, which are new.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightedLevels {
    first: u64,
    last: u64,
    /// Levels that are drawn by their weights, ascending.
    known: Vec<u64>,
    /// The sum of the weights up to each of them, its own included.
    sums: Vec<f64>,
    new: f64,
}

impl WeightedLevels {
    /// Creates it from the range `first..=last`, the levels in it that were played already, each with its weight, and the
    /// probability of a new one while there are any. Levels outside the range are ignored. A weight that is no positive
    /// number counts as 0.
    pub fn new(first: u64, last: u64, weights: impl IntoIterator<Item = (u64, f64)>, new: f64) -> Self {
        let (mut known, mut sums, mut sum) = (Vec::new(), Vec::new(), 0.0);
        let mut weights: Vec<(u64, f64)> = weights.into_iter().collect();
        weights.sort_by_key(|(level, _)| *level);
        weights.dedup_by_key(|(level, _)| *level);
        for (level, weight) in weights {
            if (first..=last).contains(&level) {
                sum += if weight > 0.0 && weight.is_finite() { weight } else { 0.0 };
                known.push(level);
                sums.push(sum);
            }
        }
        Self { first, last, known, sums, new }
    }

    /// Draws a level: a new one with its probability, each of them alike, or else one of the others by their weights.
    fn draw(&self, rng: &mut impl Rng) -> u64 {
        let news = (self.last - self.first).saturating_add(1).saturating_sub(self.known.len() as u64);
        let Some(sum) = self.sums.last().filter(|_| news == 0 || rng.random::<f64>() >= self.new) else {
            return self.nth_new(rng.random_range(0..news.max(1)));
        };
        let at = rng.random::<f64>() * sum;
        let index = self.sums.partition_point(|sum| *sum <= at).min(self.known.len() - 1);
        self.known[index]
    }

    /// Returns a level of the range that is not among the known ones, by its number among them, from 0.
    fn nth_new(&self, n: u64) -> u64 {
        let (mut low, mut high) = (0, self.known.len());
        // The number of known levels before the new one: those with at most `n` new levels before them.
        while low < high {
            let middle = usize::midpoint(low, high);
            if self.known[middle] - self.first - middle as u64 <= n { low = middle + 1 } else { high = middle }
        }
        (self.first + n).saturating_add(low as u64).min(self.last)
    }
}

/// A game's own choice of levels.
pub trait LevelSource: Send + Sync + std::fmt::Debug {
    /// Returns the next level, or `None` when no level is left.
    fn next_level(&mut self) -> Option<u64>;

    /// Returns a copy that will yield the same levels.
    fn clone_box(&self) -> Box<dyn LevelSource>;
}

impl Clone for Box<dyn LevelSource> {
    fn clone(&self) -> Self {
        self.clone_box()
    }
}

/// The file of a level: its path, and a hash of the level in it.
///
/// A level number identifies a level only until a file is added, renamed or edited. Recordings therefore keep the
/// path of the file and a hash of the level in it. A replay checks that it gets the same level.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Reflect)]
pub struct LevelFile {
    /// Path of the file, as it was found.
    pub path: String,
    /// Hash of the level, independent of the file's layout.
    pub hash: u64,
}

impl fmt::Display for LevelFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (hash {:016x})", self.path, self.hash)
    }
}

/// One value of the game that a level has drawn, by its path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct RandomisedValue {
    /// Path of the value, such as `Gravity.0`.
    pub path: String,
    /// The value that it has in this episode.
    pub value: f64,
}

impl fmt::Display for RandomisedValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.path, self.value)
    }
}

/// The values of the game that were drawn for the level of an agent's current episode. Missing if there were none.
///
/// A trainer draws them, and puts them on the agent whose episode begins. The recorder writes them with the episode, and a
/// replay of it brings them back.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, CarryComponent, Clone, Debug, PartialEq)]
pub struct RandomisedValues(pub Vec<RandomisedValue>);

/// The files of a World's levels: level i is file i. Missing where levels are not files.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct LevelFiles(Vec<LevelFile>);

impl LevelFiles {
    /// Files in the order of their level numbers.
    pub fn new(files: Vec<LevelFile>) -> Self {
        Self(files)
    }

    /// Returns the file of a level.
    pub fn of(&self, level: u64) -> Option<&LevelFile> {
        self.0.get(usize::try_from(level).ok()?)
    }

    /// Returns the current level number of a recorded file. The same file is preferred, then the
    /// same level in another file, then another level in a file of that name.
    pub fn number_of(&self, recorded: &LevelFile) -> Option<u64> {
        let find = |is_it: &dyn Fn(&LevelFile) -> bool| self.0.iter().position(is_it);
        let index = find(&|file| file == recorded)
            .or_else(|| find(&|file| file.hash == recorded.hash))
            .or_else(|| find(&|file| file.path == recorded.path))?;
        u64::try_from(index).ok()
    }

    /// Returns why this level is not the recorded one, with advice for the recording's owner;
    /// `None` if it is.
    pub fn difference(&self, level: u64, recorded: &LevelFile) -> Option<String> {
        match self.of(level) {
            Some(file) if file.hash == recorded.hash => None,
            Some(file) if file.path == recorded.path => Some(format!(
                "the level file {} has the hash {:016x}, but {:016x} in the recording: it has changed; restore the \
                 recorded file",
                file.path, file.hash, recorded.hash
            )),
            Some(file) => Some(format!(
                "the recorded level file {recorded} is missing; the level is {file} now: restore the recorded file"
            )),
            None => Some(format!("the recorded level file {recorded} is missing: restore it")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use std::collections::BTreeSet;

    #[test]
    fn new_levels_are_those_between_the_known_ones() {
        let levels = WeightedLevels::new(10, 15, [(10, 1.0), (12, f64::NAN), (13, 0.0), (99, 1.0)], 1.0);
        assert_eq!([0, 1, 2].map(|n| levels.nth_new(n)), [11, 14, 15]);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let drawn: BTreeSet<u64> = (0..100).map(|_| levels.draw(&mut rng)).collect();
        assert_eq!(drawn, BTreeSet::from([11, 14, 15]), "all are new");
        assert_eq!(WeightedLevels::new(7, 7, [], 0.0).draw(&mut rng), 7, "nothing is known yet");
    }

    #[test]
    fn known_levels_are_drawn_by_their_weights_once_there_is_no_new_one() {
        let mut queue = LevelQueue::Weighted(Arc::new(WeightedLevels::new(3, 5, [(5, 1.0), (3, 1.0), (4, 2.0)], 0.9)));
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut counts = [0; 3];
        (0..4000).for_each(|_| counts[queue.next_level(&mut rng).expect("endless") as usize - 3] += 1);
        // A quarter, a half and a quarter of 4000, within four standard deviations.
        assert!(counts.iter().zip([1000, 2000, 1000]).all(|(got, wanted)| i32::abs(got - wanted) < 127), "{counts:?}");
    }

    #[test]
    fn new_levels_come_with_their_probability() {
        let levels = WeightedLevels::new(0, 99, [(50, 3.0)], 0.25);
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let again = (0..4000).filter(|_| levels.draw(&mut rng) == 50).count();
        assert!((2890..=3110).contains(&again), "{again} of 3000 expected, within four standard deviations");
    }

    fn file(path: &str, hash: u64) -> LevelFile {
        LevelFile { path: path.to_owned(), hash }
    }

    #[test]
    fn a_recorded_file_is_found_by_name_and_hash_then_by_hash_then_by_name() {
        let files = LevelFiles::new(vec![file("a", 1), file("b", 2), file("c", 2)]);
        assert_eq!(files.number_of(&file("c", 2)), Some(2), "the same file");
        assert_eq!(files.number_of(&file("moved", 2)), Some(1), "the same level under another name");
        assert_eq!(files.number_of(&file("a", 9)), Some(0), "another level under the same name");
        assert_eq!(files.number_of(&file("gone", 9)), None);
    }

    #[test]
    fn another_level_of_the_same_name_is_reported_with_both_hashes() {
        let files = LevelFiles::new(vec![file("a.json", 0x1f)]);
        assert_eq!(files.difference(0, &file("a.json", 0x1f)), None);
        assert_eq!(files.difference(0, &file("renamed.json", 0x1f)), None);
        let words = files.difference(0, &file("a.json", 0x2e)).expect("another level");
        assert!(words.contains("the hash 000000000000001f, but 000000000000002e in the recording"), "{words}");
        assert!(words.ends_with("restore the recorded file"), "what is no recording is not recorded again: {words}");
        let words = files.difference(0, &file("b.json", 0x2e)).expect("another file");
        assert!(words.contains("b.json (hash 000000000000002e)") && words.contains("a.json"), "{words}");
        assert!(files.difference(1, &file("b.json", 0x2e)).expect("no level").contains("is missing: restore it"));
    }
}

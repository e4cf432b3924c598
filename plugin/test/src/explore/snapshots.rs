//! Snapshots of episodes on known paths: a bounded store, and the report of those that do not restore everything.

use std::{
    collections::{BTreeMap, VecDeque},
    fmt,
};

/// Most snapshots that an exploration keeps.
pub(super) const MOST_SNAPSHOTS: usize = 1024;

/// Least ticks between two snapshots of a visit. With a cell in each tick, a visit would save one in each.
pub(super) const SPACING: u32 = 8;

/// Values at ticks of segments of paths. The oldest ones are dropped first: most of them are near the start, so the
/// path to them is played quickly.
pub(super) struct SnapshotStore<T> {
    by_segment: BTreeMap<(usize, u32), T>,
    /// Segment and tick of each value, the oldest first.
    order: VecDeque<(usize, u32)>,
    most: usize,
}

impl<T> SnapshotStore<T> {
    /// Creates an empty store for this many values.
    pub fn new(most: usize) -> Self {
        Self { by_segment: BTreeMap::new(), order: VecDeque::new(), most }
    }

    /// Adds a value at a tick of a segment.
    pub fn add(&mut self, segment: usize, tick: u32, value: T) {
        if self.by_segment.insert((segment, tick), value).is_none() {
            self.order.push_back((segment, tick));
        }
        while self.order.len() > self.most {
            if let Some(oldest) = self.order.pop_front() {
                self.by_segment.remove(&oldest);
            }
        }
    }

    /// Returns the last value of a segment up to a tick.
    pub fn last_up_to(&self, segment: usize, tick: u32) -> Option<&T> {
        self.by_segment.range((segment, 0)..=(segment, tick)).next_back().map(|(_, value)| value)
    }
}

/// The first difference between a visit from a snapshot and the same visit by a replay.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotFault {
    /// Name of the game.
    pub game: &'static str,
    /// Number of the level.
    pub level: u64,
    /// The tick of the episode, from 0; `None` if the game failed after a load.
    pub tick: Option<u32>,
}

impl fmt::Display for SnapshotFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { game, level, tick } = self;
        write!(f, "the snapshot of `{game}` does not restore everything: level {level}")?;
        match tick {
            Some(tick) => write!(f, ", tick {tick}")?,
            None => f.write_str(": the game failed after a snapshot was loaded")?,
        }
        write!(
            f,
            ". The level was explored again by replays. Save all state that decides how an episode goes on, in \
             `SnapshotTools` or `.snapshot`, or leave snapshots out with --no-snapshots"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_value_up_to_a_tick_is_found_in_its_segment_only() {
        let mut store = SnapshotStore::new(9);
        store.add(1, 5, "early");
        store.add(1, 9, "late");
        store.add(2, 7, "elsewhere");
        assert_eq!(
            [4, 5, 8, 9, 99].map(|tick| store.last_up_to(1, tick)),
            [None, Some(&"early"), Some(&"early"), Some(&"late"), Some(&"late")]
        );
        assert_eq!((store.last_up_to(2, 7), store.last_up_to(0, 99)), (Some(&"elsewhere"), None));
    }

    #[test]
    fn the_oldest_values_are_dropped() {
        let mut store = SnapshotStore::new(2);
        store.add(1, 5, "a");
        store.add(1, 9, "b");
        store.add(2, 1, "c");
        assert_eq!((store.last_up_to(1, 5), store.last_up_to(1, 9)), (None, Some(&"b")));
        store.add(1, 9, "again");
        assert_eq!((store.last_up_to(1, 9), store.last_up_to(2, 1)), (Some(&"again"), Some(&"c")));
    }

    #[test]
    fn a_fault_names_game_level_and_tick_and_the_way_out() {
        let fault = SnapshotFault { game: "walk", level: 7, tick: Some(31) }.to_string();
        assert!(fault.starts_with("the snapshot of `walk` does not restore everything: level 7, tick 31. "), "{fault}");
        assert!(fault.ends_with("leave snapshots out with --no-snapshots"), "{fault}");
        let failed = SnapshotFault { game: "walk", level: 7, tick: None }.to_string();
        assert!(failed.contains("level 7: the game failed after a snapshot was loaded. "), "{failed}");
    }
}

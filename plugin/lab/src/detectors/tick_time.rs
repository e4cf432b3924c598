//! Ticks that take too long.

use std::{
    io::{self, Write},
    path::Path,
    sync::{Mutex, PoisonError},
    time::Duration,
};

use playbot_learner::disk::{self, DiskFile};
use serde::Serialize;

use crate::detector::Setting;

/// Name of the file with slow ticks in the folder of a test.
pub const TIMING: &str = "timing.jsonl";
/// Most slow ticks that are kept.
const MOST: usize = 10_000;

/// A finding for ticks that take too long. Times differ from machine to machine and from run to run, so slow ticks are
/// no part of the results and have a file of their own.
pub struct TickTime {
    pub(super) milliseconds: f64,
    slow: Mutex<Vec<SlowTick>>,
}

/// A tick that took too long.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SlowTick {
    /// Name of the detector.
    pub detector: &'static str,
    /// The tester.
    pub tester: String,
    /// Levels that were played in the World.
    pub levels: Vec<u64>,
    /// Ticks of their episodes.
    pub ticks: Vec<u32>,
    /// Its duration.
    pub milliseconds: f64,
}

impl Default for TickTime {
    fn default() -> Self {
        Self { milliseconds: 0.0, slow: Mutex::default() }
    }
}

impl TickTime {
    /// Its name.
    pub const NAME: &str = "tick-time";
    /// The defect that it finds.
    pub const ABOUT: &str = "a tick takes too long by the clock; written to timing.jsonl, not to the results";

    pub(super) fn settings(&mut self) -> Vec<Setting<'_>> {
        let what = "the longest tick of an arena; 0 for the length of a tick in game time";
        vec![Setting::new("milliseconds", &mut self.milliseconds, what)]
    }

    /// Returns whether a tick with this many agents took too long, in a game with `tick_hz` ticks per second.
    pub fn is_slow(&self, took: Duration, agents: usize, tick_hz: f64) -> bool {
        let most = if self.milliseconds > 0.0 { self.milliseconds } else { 1000.0 / tick_hz };
        took.as_secs_f64() * 1000.0 > most * agents.max(1) as f64
    }

    /// Adds a slow tick.
    pub fn note(&self, slow: SlowTick) {
        let mut known = self.slow.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() < MOST {
            known.push(slow);
        }
    }

    /// Appends the slow ticks so far to the file in a folder, and returns their number.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn write(&self, folder: &Path) -> io::Result<usize> {
        let slow = std::mem::take(&mut *self.slow.lock().unwrap_or_else(PoisonError::into_inner));
        if slow.is_empty() {
            return Ok(0);
        }
        let mut text = String::new();
        for tick in &slow {
            text.push_str(&serde_json::to_string(tick)?);
            text.push('\n');
        }
        DiskFile::append(&folder.join(TIMING))?.write_all(text.as_bytes())?;
        Ok(slow.len())
    }
}

/// Removes the slow ticks of an earlier test from a folder, if there are any.
///
/// # Errors
///
/// The file cannot be removed.
pub fn forget_timing(folder: &Path) -> io::Result<()> {
    match disk::remove_file(&folder.join(TIMING)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_ticks_are_slow_and_short_ones_are_not() {
        let usual = TickTime::default();
        let ms = Duration::from_millis;
        assert!(usual.is_slow(ms(21), 1, 50.0) && !usual.is_slow(ms(19), 1, 50.0), "a tick is 20 ms");
        assert!(!usual.is_slow(ms(39), 2, 50.0), "two arenas may take twice as long");
        let strict = TickTime { milliseconds: 5.0, ..TickTime::default() };
        assert!(strict.is_slow(ms(6), 1, 50.0) && !strict.is_slow(ms(4), 1, 50.0));
    }

    #[test]
    fn slow_ticks_are_added_to_a_file_line_by_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let times = TickTime::default();
        assert_eq!(times.write(folder.path()).expect("nothing to write"), 0);
        assert!(!folder.path().join(TIMING).exists());
        let slow = SlowTick {
            detector: TickTime::NAME,
            tester: "random".to_owned(),
            levels: vec![7],
            ticks: vec![3],
            milliseconds: 30.0,
        };
        for _ in 0..2 {
            times.note(slow.clone());
            assert_eq!(times.write(folder.path()).expect("writable"), 1);
        }
        let text = std::fs::read_to_string(folder.path().join(TIMING)).expect("readable");
        assert_eq!(text.lines().count(), 2);
        assert!(text.contains("\"levels\":[7]"), "{text}");
    }
}

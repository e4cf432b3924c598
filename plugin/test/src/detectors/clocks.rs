//! Detectors of wrong times: timers that lose episodes, time limits that are too short or differ, and levels and ticks
//! that take too long.

use crate::{
    detectors::{LevelDefect, LevelDetector, ShownBy, TestedLevel},
    explore::CellGrid,
};
use bevy::math::Vec2;
use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};
use playbot_harness::detector::{Detector, DetectorSetting, DetectorTick, EpisodeWatcher, LevelAhead};
use playbot_learner::{disk, disk::DiskFile};
use playbot_report::counted;
use serde::Serialize;
use std::{
    io,
    io::Write,
    path::Path,
    sync::{Mutex, PoisonError},
    time::Duration,
};

/// A finding for levels on which the longest episodes are lost in the same tick with their agents at different
/// positions. Only a timer can have ended them, and time limits should truncate.
///
/// It is opt-in, because some games let a timer kill on purpose.
pub struct ClockEnd {
    episodes: f64,
    distance: f64,
}

impl Default for ClockEnd {
    fn default() -> Self {
        Self { episodes: 3.0, distance: 0.25 }
    }
}

fn is_lost(result: &EpisodeResult) -> bool {
    result.end == EpisodeEnd::Terminated { success: false } && !result.success
}

impl LevelDetector for ClockEnd {
    fn name(&self) -> &'static str {
        "clock-end"
    }

    fn describe(&self) -> &'static str {
        "episodes are lost in the same tick at different positions, and none lasts longer"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("episodes", &mut self.episodes, "episodes that end so, at different positions")
                .at_least(2.0),
            DetectorSetting::new("distance", &mut self.distance, "how far apart different positions are, in tiles"),
        ]
    }

    fn compares_testers(&self) -> bool {
        true
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let Some(longest) = level.episodes().map(|(_, _, result)| result.ticks).max() else { return Vec::new() };
        let is_last = move |result: &EpisodeResult| result.ticks == longest && !result.success;
        let last = || level.episodes().filter(move |(_, _, result)| is_last(result));
        if last().count() < self.episodes as usize || !last().all(|(_, _, result)| is_lost(result)) {
            return Vec::new();
        }
        let plan = level.game.tools().levels.floor_plan(level.mode, level.level);
        let apart = self.distance as f32 * CellGrid::new(plan.as_ref(), None).size;
        let mut positions: Vec<Vec2> = Vec::new();
        let ended =
            level.testers.iter().flat_map(|tester| tester.episodes.iter().map(move |episode| (tester, episode)));
        for (tester, (number, _)) in ended.filter(|(_, (_, result))| is_last(result)) {
            if let Some(&position) = tester.positions.get(number)
                && positions.iter().all(|other| other.distance(position) > apart)
            {
                positions.push(position);
            }
        }
        if positions.len() < self.episodes as usize {
            return Vec::new();
        }
        let first = last().next();
        let defect = first.map(|(tester, episode, _)| LevelDefect {
            tester: Some(tester.to_owned()),
            episode: Some(episode),
            tick: longest.checked_sub(1),
            settings: Vec::new(),
            message: format!(
                "{} episodes are lost after {} at different positions, and none lasts longer",
                positions.len(),
                counted(u64::from(longest), "tick")
            ),
        });
        defect.into_iter().collect()
    }

    fn shown_by(&self) -> ShownBy {
        ShownBy::Episode
    }

    fn is_in_episode(&self, result: &EpisodeResult, tick: Option<u32>) -> bool {
        is_lost(result) && tick.is_none_or(|tick| result.ticks == tick.saturating_add(1))
    }
}

/// A finding for time limits before which the agent could not have reached the goal, even straight through all walls,
/// at its fastest pace. An agent that goes nowhere shows no pace.
pub struct ShortTime {
    factor: f64,
    tiles: f64,
}

impl Default for ShortTime {
    fn default() -> Self {
        Self { factor: 2.0, tiles: 3.0 }
    }
}

/// Largest distance at which a goal may be reached, in tiles.
const AT_GOAL: f32 = 2.0;

struct Going {
    goal: Vec2,
    tile: f32,
    factor: f32,
    least: f32,
    first: Option<Vec2>,
    last: Vec2,
    /// Longest move in a tick, along each axis.
    fastest: Vec2,
    /// Largest distance from the first position, along each axis.
    farthest: Vec2,
}

impl Detector for ShortTime {
    fn name(&self) -> &'static str {
        "short-time"
    }

    fn describe(&self) -> &'static str {
        "time is up before the agent could have come to the goal at its fastest pace"
    }

    fn is_default(&self) -> bool {
        false
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("factor", &mut self.factor, "times the fastest pace that the agent has shown")
                .at_least(1.0),
            DetectorSetting::new(
                "tiles",
                &mut self.tiles,
                "tiles that the agent must have gone to have shown its pace",
            ),
        ]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        let plan = level.plan.as_ref()?;
        let tile = CellGrid::new(Some(plan), None).size;
        Some(Box::new(Going {
            goal: plan.goal,
            tile,
            factor: self.factor as f32,
            least: self.tiles as f32 * tile,
            first: None,
            last: Vec2::ZERO,
            fastest: Vec2::ZERO,
            farthest: Vec2::ZERO,
        }))
    }
}

impl EpisodeWatcher for Going {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let position = moment.position.filter(|position| position.is_finite())?;
        if let Some(first) = self.first {
            self.fastest = self.fastest.max((position - self.last).abs());
            self.farthest = self.farthest.max((position - first).abs());
        } else {
            self.first = Some(position);
        }
        self.last = position;
        None
    }

    fn end(&mut self, _moment: &DetectorTick<'_>, result: &EpisodeResult) -> Option<String> {
        if result.end != EpisodeEnd::Truncated || result.success {
            return None;
        }
        let first = self.first?;
        let way = (self.goal - first).abs() - AT_GOAL * self.tile;
        let most = self.fastest * self.factor * result.ticks as f32;
        let mut axes = way.to_array().into_iter().zip(most.to_array()).zip(self.farthest.to_array());
        let is_short = axes.any(|((way, most), gone)| gone >= self.least && most < way);
        is_short.then(|| {
            format!(
                "time was up after {} ticks, too few to come from {:.1}, {:.1} to the goal at {:.1}, {:.1}",
                result.ticks, first.x, first.y, self.goal.x, self.goal.y
            )
        })
    }
}

/// A finding for levels that testers solve, but never within their par, by the designer or by demonstrations. Levels
/// without a par are skipped.
pub struct TooLong {
    factor: f64,
    par: f64,
}

impl Default for TooLong {
    fn default() -> Self {
        Self { factor: 1.0, par: 0.0 }
    }
}

impl LevelDetector for TooLong {
    fn name(&self) -> &'static str {
        "too-long"
    }

    fn describe(&self) -> &'static str {
        "the level is solved, and never within its par"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("factor", &mut self.factor, "times the par that it may take"),
            DetectorSetting::new("par", &mut self.par, "ticks that a level should take; 0 for those of --par"),
        ]
    }

    fn compares_testers(&self) -> bool {
        true
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let par = if self.par > 0.0 { Some(self.par) } else { level.par };
        let Some(most) = par.map(|par| par * self.factor) else { return Vec::new() };
        let solved = level.episodes().filter(|(_, _, result)| result.success);
        let fastest = solved.min_by_key(|(_, _, result)| result.ticks);
        let slow = fastest.filter(|(_, _, result)| f64::from(result.ticks) > most);
        let defect = slow.map(|(tester, episode, result)| LevelDefect {
            tester: Some(tester.to_owned()),
            episode: Some(episode),
            tick: result.ticks.checked_sub(1),
            settings: Vec::new(),
            message: format!(
                "solved in {} at best, where {most} should be enough",
                counted(u64::from(result.ticks), "tick")
            ),
        });
        defect.into_iter().collect()
    }
}

/// A finding for time limits that are shorter than another episode of the level. It is opt-in, because some games give
/// more time for progress, or truncate for other reasons.
#[derive(Default)]
pub struct UnevenTime;

fn is_timed_out(result: &EpisodeResult) -> bool {
    result.end == EpisodeEnd::Truncated && !result.success
}

impl LevelDetector for UnevenTime {
    fn name(&self) -> &'static str {
        "uneven-time"
    }

    fn describe(&self) -> &'static str {
        "time is up earlier than in another episode of the level"
    }

    fn compares_testers(&self) -> bool {
        true
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let Some(longest) = level.episodes().map(|(_, _, result)| result.ticks).max() else { return Vec::new() };
        let timed_out = level.episodes().filter(|(_, _, result)| is_timed_out(result) && result.ticks < longest);
        let defect = timed_out.min_by_key(|(_, _, result)| result.ticks).map(|(tester, episode, result)| LevelDefect {
            tester: Some(tester.to_owned()),
            episode: Some(episode),
            tick: result.ticks.checked_sub(1),
            settings: Vec::new(),
            message: format!("time was up after {} ticks, and another episode took {longest}", result.ticks),
        });
        defect.into_iter().collect()
    }

    fn shown_by(&self) -> ShownBy {
        ShownBy::Episode
    }

    fn is_in_episode(&self, result: &EpisodeResult, tick: Option<u32>) -> bool {
        is_timed_out(result) && tick.is_none_or(|tick| result.ticks == tick.saturating_add(1))
    }
}

/// Name of the file with slow ticks in the folder of a test.
pub const TIMING: &str = "timing.jsonl";

/// Most slow ticks that are kept.
const MOST: usize = 10_000;

/// A finding for ticks that take too long. Times differ from machine to machine and from run to run. So slow ticks are
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

    pub(super) fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        let what = "the longest tick of an arena; 0 for the length of a tick in game time";
        vec![DetectorSetting::new("milliseconds", &mut self.milliseconds, what)]
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
    use crate::detectors::testing::{LOST, Step, TIMED_OUT, WON, inspected, room, timed_out_proving};
    use bevy::math::Rect;
    use playbot_harness::detector::NoProofs;

    #[test]
    fn who_is_lost_in_one_tick_wherever_they_are_is_found() {
        let episodes = [(LOST, 20, [1.0, 1.0]), (LOST, 20, [4.0, 1.0]), (WON, 20, [8.0, 8.0]), (LOST, 20, [2.0, 5.0])];
        let found = inspected(&ClockEnd::default(), &episodes, None);
        assert_eq!((found.len(), found[0].tick, found[0].episode), (1, Some(19), Some(0)));
        assert!(found[0].message.contains("3 episodes are lost after 20 ticks"), "{}", found[0].message);
    }

    #[test]
    fn who_dies_at_one_place_earlier_than_others_or_when_time_is_up_is_sound() {
        let at = |end, ticks: [u32; 4], step: f32| {
            [0, 1, 2, 3].map(|episode: usize| (end, ticks[episode], [1.0 + step * episode as f32, 1.0]))
        };
        for sound in [
            at(LOST, [20; 4], 0.0),
            at(LOST, [20, 20, 20, 21], 1.0),
            at(LOST, [20, 18, 20, 7], 1.0),
            at(TIMED_OUT, [20; 4], 1.0),
        ] {
            assert!(inspected(&ClockEnd::default(), &sound, None).is_empty(), "{sound:?}");
        }
    }

    /// The room with its goal 100 tiles away.
    fn long() -> LevelAhead {
        let mut level = room();
        let plan = level.plan.as_mut().expect("a plan");
        (plan.bounds, plan.goal) = (Rect::new(0.0, 0.0, 110.0, 10.0), Vec2::new(101.0, 1.5));
        level
    }

    fn run(ticks: usize, pace: f32) -> Vec<Step> {
        (0..ticks).map(|tick| Step::at(tick, 1.0 + pace * tick as f32, 1.5)).collect()
    }

    fn reported(steps: &[Step]) -> Option<String> {
        timed_out_proving(&ShortTime::default(), &long(), steps, &NoProofs).map(|(_, message)| message)
    }

    #[test]
    fn a_limit_that_cannot_be_kept_is_found() {
        // 40 ticks at twice the pace of half a tile are 40 tiles of 98.
        let message = reported(&run(40, 0.5)).expect("too short");
        assert!(message.contains("after 40 ticks") && message.contains("from 1.0, 1.5"), "{message}");
    }

    #[test]
    fn a_limit_that_somebody_might_keep_and_an_agent_that_goes_nowhere_are_sound() {
        assert_eq!(reported(&run(100, 0.5)), None, "100 tiles are enough");
        assert_eq!(reported(&run(40, 0.0)), None);
        assert_eq!(reported(&run(40, 0.05)), None, "two tiles show no pace");
        let jumps: Vec<Step> = (0..40).map(|tick| Step::at(tick, 1.0, 1.5 + (tick % 8) as f32)).collect();
        assert_eq!(reported(&jumps), None, "up and down is no way along x");
    }

    #[test]
    fn a_level_not_solved_within_its_par_is_found() {
        let episodes = [(WON, 90, [1.0; 2]), (WON, 70, [1.0; 2]), (LOST, 5, [1.0; 2])];
        let found = inspected(&TooLong::default(), &episodes, Some(60.0));
        assert_eq!((found.len(), found[0].episode, found[0].tick), (1, Some(1), Some(69)));
        assert!(found[0].message.contains("solved in 70 ticks at best, where 60"), "{}", found[0].message);
        let by_setting = TooLong { par: 50.0, ..TooLong::default() };
        assert_eq!(inspected(&by_setting, &episodes, Some(100.0)).len(), 1);
    }

    #[test]
    fn a_level_within_its_par_without_one_or_unsolved_is_silent() {
        let episodes = [(WON, 90, [1.0; 2]), (WON, 70, [1.0; 2])];
        assert!(inspected(&TooLong::default(), &episodes, Some(70.0)).is_empty());
        assert!(inspected(&TooLong::default(), &episodes, None).is_empty());
        assert!(inspected(&TooLong::default(), &[(LOST, 90, [1.0; 2])], Some(1.0)).is_empty());
    }

    const HERE: [f32; 2] = [1.0, 1.0];

    #[test]
    fn time_that_is_up_too_early_is_found() {
        for other in [(TIMED_OUT, 100, HERE), (WON, 41, HERE), (LOST, 60, HERE)] {
            let found = inspected(&UnevenTime, &[other, (TIMED_OUT, 40, HERE)], None);
            assert_eq!((found.len(), found[0].episode, found[0].tick), (1, Some(1), Some(39)));
        }
    }

    #[test]
    fn one_limit_for_all_is_sound() {
        let same = [(TIMED_OUT, 40, HERE), (WON, 40, HERE), (LOST, 12, HERE), (TIMED_OUT, 40, HERE)];
        assert!(inspected(&UnevenTime, &same, None).is_empty());
        assert!(inspected(&UnevenTime, &[], None).is_empty());
    }

    #[test]
    fn long_ticks_are_slow_and_short_ones_are_not() {
        let default = TickTime::default();
        let ms = Duration::from_millis;
        assert!(default.is_slow(ms(21), 1, 50.0) && !default.is_slow(ms(19), 1, 50.0), "a tick is 20 ms");
        assert!(!default.is_slow(ms(39), 2, 50.0), "two arenas may take twice as long");
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

//! Time limits that differ.

use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};

use super::level_detector::{LevelDefect, LevelDetector, ShownBy, TestedLevel};

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{LOST, TIMED_OUT, WON, inspected};

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
}

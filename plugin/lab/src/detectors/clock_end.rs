//! Episodes that a timer loses.

use bevy::math::Vec2;
use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};

use super::level_detector::{LevelDefect, LevelDetector, ShownBy, TestedLevel};
use crate::{detector::Setting, explore::CellGrid};

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
        "episodes are lost in the same tick at different places, and none lasts longer"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![
            Setting::new("episodes", &mut self.episodes, "episodes that end so, at different places").at_least(2.0),
            Setting::new("distance", &mut self.distance, "how far apart different places are, in tiles"),
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
        let mut places: Vec<Vec2> = Vec::new();
        let ended =
            level.testers.iter().flat_map(|tester| tester.episodes.iter().map(move |episode| (tester, episode)));
        for (tester, (number, _)) in ended.filter(|(_, (_, result))| is_last(result)) {
            if let Some(&place) = tester.places.get(number)
                && places.iter().all(|other| other.distance(place) > apart)
            {
                places.push(place);
            }
        }
        if places.len() < self.episodes as usize {
            return Vec::new();
        }
        let first = last().next();
        let defect = first.map(|(tester, episode, _)| LevelDefect {
            tester: Some(tester.to_owned()),
            episode: Some(episode),
            tick: longest.checked_sub(1),
            settings: Vec::new(),
            message: format!(
                "{} episodes are lost after {longest} ticks at different places, and none lasts longer",
                places.len()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{LOST, TIMED_OUT, WON, inspected};

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
}

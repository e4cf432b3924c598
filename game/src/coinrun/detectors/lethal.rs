//! Detectors of harmless hazards, and of deaths without one.

use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};
use playbot_lab::detector::{Detector, EachTick, LevelAhead, Moment, Watch};

use super::contact::{goes_on, place, touched};
use crate::coinrun::Outcome;

/// Finds a player that touches a hazard in an episode that goes on.
pub(super) fn harmless_hazard() -> impl Detector {
    EachTick::new(
        "harmless-hazard",
        "a saw, an enemy or lava is touched and the episode goes on",
        |moment: &Moment<'_>| {
            if !goes_on(moment) {
                return None;
            }
            let what = match touched(moment)? {
                Outcome::Saw => "a saw",
                Outcome::Enemy => "an enemy",
                Outcome::Lava => "lava",
                Outcome::Coin | Outcome::LeftMap | Outcome::Timeout => return None,
            };
            Some(format!("touches {what} at {}, and the episode goes on", place(moment)))
        },
    )
}

/// A player dies away from every hazard.
pub(super) struct FarHazard;

struct Looking;

impl Detector for FarHazard {
    fn name(&self) -> &'static str {
        "far-hazard"
    }

    fn describe(&self) -> &'static str {
        "an episode is lost without touching a hazard"
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn Watch>> {
        Some(Box::new(Looking))
    }
}

impl Watch for Looking {
    fn tick(&mut self, _moment: &Moment<'_>) -> Option<String> {
        None
    }

    fn end(&mut self, moment: &Moment<'_>, result: &EpisodeResult) -> Option<String> {
        let is_unfounded = result.end == EpisodeEnd::LOST && touched(moment).is_none_or(Outcome::is_success);
        is_unfounded.then(|| format!("lost at {} without touching a hazard", place(moment)))
    }
}

#[cfg(test)]
mod tests {
    use crate::coinrun::detectors::testing::{Bot, first_named, planted, sound};

    #[test]
    fn hazards_that_do_not_kill_are_found_and_those_that_do_are_not() {
        assert!(first_named("harmless-hazard", &planted("harmless-hazard", 0), Bot::RightJump, 0..40).is_some());
        assert_eq!(first_named("harmless-hazard", &sound(), Bot::RightJump, 0..40), None);
    }

    #[test]
    fn deaths_far_from_hazards_are_found_and_others_are_not() {
        for variant in [0, 3] {
            let planted = planted("far-hazard", variant);
            assert!(first_named("far-hazard", &planted, Bot::RightJump, 0..40).is_some(), "{variant}");
        }
        assert_eq!(first_named("far-hazard", &sound(), Bot::RightJump, 0..40), None);
    }
}

//! The checks of all detectors, by name.

use bevy_playbot::episode::EpisodeEnd;

use super::{
    breakage::say_the_same,
    check::Check,
    failure::{LOST, NOT_SOLVED},
    head::FindingHead,
    play::Replayed,
};
use crate::game::Game;

/// Checks by the names of their detectors.
#[derive(Clone)]
pub struct Checks {
    checks: Vec<(&'static str, Check)>,
    /// The detectors among them with all their settings, in the form of
    /// [`Detectors::record`](crate::detectors::Detectors::record).
    pub(super) records: Vec<String>,
    /// Settings that the caller asked for, as `name.key=value`.
    pub(super) asked: Vec<String>,
}

impl Default for Checks {
    /// Creates the checks of the general findings of tests.
    fn default() -> Self {
        let checks = vec![
            ("panic", Check::Episode(is_broken)),
            ("fault", Check::Episode(is_broken)),
            ("endless", Check::Episode(is_broken)),
            ("unreachable-goal", Check::Level(is_unreachable)),
            (LOST, Check::Episode(is_lost)),
            (NOT_SOLVED, Check::Episode(is_not_solved)),
        ];
        Self { checks, records: Vec::new(), asked: Vec::new() }
    }
}

impl Checks {
    /// Adds a check; it replaces the one with its name.
    #[must_use]
    pub fn with(mut self, detector: &'static str, check: Check) -> Self {
        self.checks.retain(|(name, _)| *name != detector);
        self.checks.push((detector, check));
        self
    }

    /// Returns the check of a detector.
    pub fn of(&self, detector: &str) -> Option<Check> {
        self.checks.iter().find(|(name, _)| *name == detector).map(|(_, check)| check.clone())
    }

    /// Returns the names of the detectors.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.checks.iter().map(|(name, _)| *name)
    }
}

/// Checks that the game breaks in the same way.
fn is_broken(head: &FindingHead, replayed: &Replayed) -> Option<u32> {
    let broken = replayed.broken.as_ref()?;
    (broken.detector == head.detector && say_the_same(&broken.message, &head.message)).then_some(broken.tick)
}

/// Checks that the goal is still proved to be out of reach.
fn is_unreachable(game: &dyn Game, mode: &str, level: u64) -> bool {
    game.tools().levels.prove(mode, level).why_unsolvable().is_some()
}

/// Checks that the game ends the episode before the goal. Returns the tick of the end.
fn is_lost(_: &FindingHead, replayed: &Replayed) -> Option<u32> {
    let end = replayed.end.filter(|end| end.end == EpisodeEnd::Terminated { success: false } && !end.success)?;
    end.ticks.checked_sub(1)
}

/// Checks that the time limit ends the episode before the goal. Returns the tick of the end.
fn is_not_solved(_: &FindingHead, replayed: &Replayed) -> Option<u32> {
    let end = replayed.end.filter(|end| end.end == EpisodeEnd::Truncated && !end.success)?;
    end.ticks.checked_sub(1)
}

#[cfg(test)]
mod tests {
    use bevy_playbot::episode::EpisodeResult;

    use super::*;
    use crate::findings::{Breakage, testing::head};

    fn ended(end: EpisodeEnd) -> Replayed {
        let success = end.is_success();
        let end = EpisodeResult { level: 3, end, success, ticks: 9, clipped: 0, total_reward: 0.0 };
        Replayed { end: Some(end), ..Replayed::default() }
    }

    #[test]
    fn each_end_is_a_finding_of_its_own() {
        let found = |detector: &str, replayed: &Replayed| match Checks::default().of(detector) {
            Some(Check::Episode(check)) => check(&head(detector), replayed),
            _ => panic!("{detector} looks at episodes"),
        };
        let lost = ended(EpisodeEnd::Terminated { success: false });
        let (won, late) = (ended(EpisodeEnd::Terminated { success: true }), ended(EpisodeEnd::Truncated));
        assert_eq!([&lost, &won, &late].map(|end| found("lost", end)), [Some(8), None, None]);
        assert_eq!([&lost, &won, &late].map(|end| found("not-solved", end)), [None, None, Some(8)]);
        let broken = Breakage { detector: "panic", tick: 4, message: head("panic").message };
        let broken = Replayed { broken: Some(broken), ..Replayed::default() };
        assert_eq!((found("panic", &broken), found("fault", &broken)), (Some(4), None));
    }

    #[test]
    fn a_detector_of_ones_own_is_found_by_its_name() {
        let checks =
            Checks::default().with("crowd", Check::Level(|_, _, _| true)).with("lost", Check::Level(|_, _, _| true));
        assert!(checks.of("crowd").is_some() && checks.of("crowds").is_none());
        assert!(matches!(checks.of("lost"), Some(Check::Level(_))), "it takes the place of the old one");
        assert_eq!(checks.names().count(), Checks::default().names().count() + 1);
    }
}

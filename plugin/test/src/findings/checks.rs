//! The checks that reproduce a finding.

use crate::{
    detectors::{DetectorChoice, Detectors, GameProofs, LevelDetector, ShownBy},
    findings::{
        FindingHead,
        play::{CheckTick, Replayed, Watcher, say_the_same},
    },
};
use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};
use playbot_harness::{
    detector,
    detector::{Detector, EpisodeWatcher, LevelAhead, WorldTick, WorldWatcher},
    game::{Game, prove_level},
};
use playbot_report::counted;
use std::{cell::RefCell, rc::Rc, sync::Arc};

/// The check that reproduces a detector's findings.
#[derive(Clone)]
pub enum Check {
    /// Examines the level, without play. Returns whether the finding of this mode and level is there.
    Level(fn(&dyn Game, &str, u64) -> bool),
    /// Examines the result of the episode. Returns the tick of the finding, if it is there.
    Episode(fn(&FindingHead, &Replayed) -> Option<u32>),
    /// Watches the World tick by tick; each replay gets a watcher of its own.
    Ticks(Arc<dyn Fn(&FindingHead) -> Watcher + Send + Sync>),
    /// Runs a detector during play. The message is then the new one.
    Detector(Arc<dyn Detector>),
    /// Runs a detector of whole levels: on the level, or on the result of the episode, as it
    /// [declares](LevelDetector::shown_by).
    WholeLevel(Arc<dyn LevelDetector>),
}

impl Check {
    /// Returns whether the check needs a replay.
    pub fn needs_play(&self) -> bool {
        match self {
            Self::Level(_) => false,
            Self::Episode(_) | Self::Ticks(_) | Self::Detector(_) => true,
            Self::WholeLevel(detector) => detector.shown_by() == ShownBy::Episode,
        }
    }
}

/// Checks by the names of their detectors.
#[derive(Clone)]
pub struct Checks {
    checks: Vec<(&'static str, Check)>,
    /// The detectors among them with all their settings, in the form of
    /// [`Detectors::record`].
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
            (REPORT, Check::Episode(is_reported)),
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
    prove_level(game, mode, level).why_unsolvable().is_some()
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

/// Checks that the state which somebody has reported is there in the same tick. Whether it is wrong is for people to say.
fn is_reported(head: &FindingHead, replayed: &Replayed) -> Option<u32> {
    let tick = head.tick?;
    let state = replayed.state_hashes.get(tick as usize);
    (state.is_some() && state == head.state_hash.as_ref()).then_some(tick)
}

// Failed episodes as findings.

/// The game ended the episode before the goal.
pub const LOST: &str = "lost";

/// The time limit ended the episode before the goal.
pub const NOT_SOLVED: &str = "not-solved";

/// A tester has reported the state in its own words, such as a language model that plays.
pub const REPORT: &str = "report";

/// Returns the kind of an episode that ended before the goal, and its message; `None` if the goal was reached.
pub(super) fn failure_of(end: &EpisodeResult) -> Option<(&'static str, String)> {
    if end.success {
        return None;
    }
    let ticks = counted(u64::from(end.ticks), "tick");
    match end.end {
        EpisodeEnd::Terminated { success: true } => None,
        EpisodeEnd::Terminated { success: false } => Some((LOST, format!("the game ended the episode after {ticks}"))),
        EpisodeEnd::Truncated => Some((NOT_SOLVED, format!("time was up after {ticks}"))),
    }
}

/// Returns the message about a replayed episode with this finding, if it is known: the panic or fault, or the failure.
pub(super) fn message_of(detector: &str, replayed: &Replayed) -> Option<String> {
    let broken = replayed.broken.as_ref().filter(|broken| broken.detector == detector);
    let failed = || replayed.end.as_ref().and_then(failure_of).filter(|(name, _)| *name == detector);
    broken.map(|broken| broken.message.clone()).or_else(|| failed().map(|(_, words)| words))
}

// Checks of detectors that watch play.

impl Checks {
    /// Returns the checks of general findings, and of all detectors of this game with their default settings.
    pub fn of_game(game: &dyn Game) -> Self {
        let choice = DetectorChoice { with: vec!["all".to_owned()], ..DetectorChoice::default() };
        let all = Detectors::choose(game, &choice).unwrap_or_else(|_| Detectors::defaults(game));
        Self::default().with_detectors(&all)
    }

    /// Adds the checks of the detectors of a test, with their settings. Detectors of whole levels have a check if a
    /// level or the end of an episode [reproduces](ShownBy) their findings.
    #[must_use]
    pub fn with_detectors(self, detectors: &Detectors) -> Self {
        let checks = self.with_records(detectors.record(), &detectors.settings);
        let checks = detectors
            .ticks
            .iter()
            .fold(checks, |checks, detector| checks.with(detector.name(), Check::Detector(Arc::clone(detector))));
        let shown = detectors.levels.iter().filter(|detector| detector.shown_by() != ShownBy::Nothing);
        shown.fold(checks, |checks, detector| checks.with(detector.name(), Check::WholeLevel(Arc::clone(detector))))
    }
}

/// Runs the detector as in a test. The second value holds its message, once it has seen something.
pub(super) fn watcher(detector: Arc<dyn Detector>) -> (Watcher, Rc<RefCell<Option<String>>>) {
    let said = Rc::<RefCell<Option<String>>>::default();
    let (mut looking, heard) = (Looking::new(detector), Rc::clone(&said));
    let watcher: Watcher = Box::new(move |moment: &CheckTick| {
        let words = looking.look(moment)?;
        *heard.borrow_mut() = Some(words);
        Some(moment.tick)
    });
    (watcher, said)
}

/// A detector at work in the World of one episode.
pub(super) struct Looking {
    detector: Arc<dyn Detector>,
    worlds: Option<Box<dyn WorldWatcher>>,
    /// `None` before the first tick.
    begun: Option<Option<Box<dyn EpisodeWatcher>>>,
}

impl Looking {
    pub fn new(detector: Arc<dyn Detector>) -> Self {
        let worlds = detector.watch_world();
        Self { detector, worlds, begun: None }
    }

    /// Examines a tick. Returns a message if something is wrong.
    pub fn look(&mut self, moment: &CheckTick) -> Option<String> {
        let CheckTick { game, mode, world, agent, tick, end, errors } = *moment;
        let seen = detector::DetectorTick::of_agent(world, agent, tick)?;
        let level = seen.level;
        let ahead = || LevelAhead { level, plan: game.tools().levels.floor_plan(mode, level) };
        let watch = self.begun.get_or_insert_with(|| self.detector.watch(&ahead()));
        let proofs = GameProofs { game, mode, level, world, agent };
        let seen = detector::DetectorTick {
            position: game.tools().state.position(world, agent),
            height: game.tools().state.height(world, agent),
            is_success: end.map_or(seen.is_success, |end| end.success),
            proofs: &proofs,
            ..seen
        };
        let in_episode = watch.as_mut().and_then(|watch| {
            let now = watch.tick(&seen);
            now.or_else(|| end.and_then(|end| watch.end(&seen, &end)))
        });
        in_episode.or_else(|| self.worlds.as_mut()?.tick(&WorldTick { world, errors }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::{Breakage, testing::head};
    use bevy_playbot::episode::EpisodeResult;

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
    fn a_report_is_there_in_its_tick_with_its_state() {
        let Some(Check::Episode(check)) = Checks::default().of(REPORT) else { panic!("it looks at episodes") };
        let head = |tick, hash| FindingHead { tick, state_hash: hash, ..head(REPORT) };
        let replayed = Replayed { state_hashes: vec![7, 8, 9], ..Replayed::default() };
        assert_eq!(check(&head(Some(1), Some(8)), &replayed), Some(1));
        for (tick, hash) in [(Some(1), Some(9)), (Some(3), Some(9)), (Some(1), None), (None, Some(8)), (Some(3), None)]
        {
            assert_eq!(check(&head(tick, hash), &replayed), None, "{tick:?} {hash:?}");
        }
    }

    #[test]
    fn a_detector_of_ones_own_is_found_by_its_name() {
        let checks =
            Checks::default().with("crowd", Check::Level(|_, _, _| true)).with("lost", Check::Level(|_, _, _| true));
        assert!(checks.of("crowd").is_some() && checks.of("crowds").is_none());
        assert!(matches!(checks.of("lost"), Some(Check::Level(_))), "it takes the place of the old one");
        assert_eq!(checks.names().count(), Checks::default().names().count() + 1);
    }

    fn result_of(end: EpisodeEnd) -> EpisodeResult {
        EpisodeResult { level: 3, end, success: end.is_success(), ticks: 47, clipped: 0, total_reward: 0.0 }
    }

    #[test]
    fn each_failure_has_its_name_and_the_ticks_of_this_episode() {
        let (name, words) = failure_of(&result_of(EpisodeEnd::Terminated { success: false })).expect("it failed");
        assert_eq!((name, words.as_str()), (LOST, "the game ended the episode after 47 ticks"));
        assert!(!words.contains(name), "its name is not repeated in its message");
        let (name, words) = failure_of(&result_of(EpisodeEnd::Truncated)).expect("it failed");
        assert_eq!((name, words.as_str()), (NOT_SOLVED, "time was up after 47 ticks"));
        assert_eq!(failure_of(&result_of(EpisodeEnd::Terminated { success: true })), None);
    }

    #[test]
    fn only_what_was_looked_for_has_words() {
        let end = Some(result_of(EpisodeEnd::Truncated));
        let replayed = Replayed { end, ..Replayed::default() };
        assert_eq!(message_of(NOT_SOLVED, &replayed).as_deref(), Some("time was up after 47 ticks"));
        assert_eq!(message_of(LOST, &replayed), None);
        let broken = Breakage { detector: "panic", tick: 4, message: "value 7 burns".to_owned() };
        let replayed = Replayed { broken: Some(broken), ..Replayed::default() };
        assert_eq!(message_of("panic", &replayed).as_deref(), Some("value 7 burns"));
        assert_eq!(message_of("fault", &replayed), None);
    }
}

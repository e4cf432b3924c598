//! The scan of one episode's actions with all detectors.

use crate::{
    detectors::{DetectorChoice, Detectors, list},
    findings::{
        FindingHead,
        checks::{Check, Checks, Looking},
        play::{CheckTick, Setting, Watcher, play_actions},
    },
};
use bevy_playbot::{action::ActionValue, episode::EpisodeResult};
use playbot_harness::game::Game;
use std::{cell::RefCell, rc::Rc, sync::Arc};

/// A message of a detector, or a panic or fault.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// The detector; or `panic`, `fault` or `endless`.
    pub detector: &'static str,
    /// Tick of the episode.
    pub tick: u32,
    /// The message.
    pub message: String,
}

/// The result of a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// The messages, in the order of the ticks; each detector has at most one.
    pub seen: Vec<Seen>,
    /// The result of the episode, if it ended.
    pub end: Option<EpisodeResult>,
}

/// Plays actions on a level, up to their end or that of the episode, with all detectors that watch tick by tick.
pub fn scan(
    game: &dyn Game,
    mode: &str,
    level: u64,
    seed: u64,
    actions: &[ActionValue],
    detectors: &Detectors,
) -> Scan {
    let seen = Rc::<RefCell<Vec<Seen>>>::default();
    let mut looking: Vec<(&'static str, Looking)> =
        detectors.ticks.iter().map(|detector| (detector.name(), Looking::new(Arc::clone(detector)))).collect();
    let notes = Rc::clone(&seen);
    let watcher: Watcher = Box::new(move |moment: &CheckTick| {
        looking.retain_mut(|(detector, looking)| {
            let message = looking.look(moment);
            let is_silent = message.is_none();
            let note = message.map(|message| Seen { detector, tick: moment.tick, message });
            notes.borrow_mut().extend(note);
            is_silent
        });
        // Other detectors may still see more.
        None
    });
    let replayed = play_actions(Setting { game, mode, level, seed }, actions, Some(watcher));
    let mut seen = seen.take();
    seen.extend(replayed.broken.map(|broken| Seen {
        detector: broken.detector,
        tick: broken.tick,
        message: broken.message,
    }));
    Scan { seen, end: replayed.end }
}

impl Checks {
    /// Replaces the settings of detectors.
    pub(super) fn with_records(mut self, records: &[String], asked: &[String]) -> Self {
        self.records.retain(|old| !records.iter().any(|new| name_of(new) == name_of(old)));
        self.records.extend_from_slice(records);
        asked.clone_into(&mut self.asked);
        self
    }

    /// Returns the settings of a detector that differ from the default, as `name.key=value`.
    pub(super) fn settings_of(&self, game: &dyn Game, detector: &str) -> Vec<String> {
        let Some(record) = self.records.iter().find(|record| name_of(record) == detector) else { return Vec::new() };
        let default = list(game).into_iter().find(|known| known.name == detector);
        let default: Vec<String> = default.map_or_else(Vec::new, |known| {
            known.settings.iter().map(|(key, value, _)| format!("{key}={value}")).collect()
        });
        let values = record.split(' ').skip(1).filter(|value| !default.iter().any(|known| known == value));
        values.map(|value| format!("{detector}.{value}")).collect()
    }

    /// Returns the settings of a detector that the caller asked for, default ones included.
    fn asked_of(&self, detector: &str) -> Vec<String> {
        let is_own = |text: &&String| text.split_once('.').is_some_and(|(name, _)| name == detector);
        self.asked.iter().filter(is_own).cloned().collect()
    }

    /// Returns the check of a finding: its detector has the settings of the finding, except for those that are set
    /// here.
    pub(super) fn of_finding(&self, game: &dyn Game, head: &FindingHead) -> Option<Check> {
        let check = self.of(&head.detector)?;
        let has_settings = matches!(check, Check::Detector(_) | Check::WholeLevel(_));
        if head.settings.is_empty() || !has_settings {
            return Some(check);
        }
        // The last one wins.
        let settings = [head.settings.clone(), self.asked_of(&head.detector)].concat();
        let choice = DetectorChoice { with: vec!["all".to_owned()], settings, ..DetectorChoice::default() };
        // A setting that the detector no longer has is ignored.
        let set = Detectors::choose(game, &choice).ok();
        let set = set.and_then(|all| Self::default().with_detectors(&all).of(&head.detector));
        Some(set.unwrap_or(check))
    }
}

fn name_of(record: &str) -> &str {
    record.split_once(' ').map_or(record, |(name, _)| name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        detectors::DetectorChoice,
        findings::{FindingStatus, StoredFinding, keep::recheck},
    };
    use bevy_playbot::action::ActionValue;
    use playbot_corridor::{Corridor, Rule, to_the_goal};

    fn scanned(game: &Corridor, actions: &[ActionValue]) -> Scan {
        let choice = DetectorChoice { without: vec!["tick-time".to_owned()], ..DetectorChoice::default() };
        let detectors = Detectors::choose(game, &choice).expect("there are such");
        scan(game, "plain", 3, 0, actions, &detectors)
    }

    #[test]
    fn a_sound_way_shows_nothing_and_a_broken_one_what_broke() {
        let sound = scanned(&Corridor::default(), &to_the_goal());
        assert_eq!(sound.seen, []);
        assert!(sound.end.is_some_and(|end| end.success));
        let burning = scanned(&Corridor { rule: Rule::Panics }, &to_the_goal());
        assert_eq!(burning.seen.iter().map(|seen| seen.detector).collect::<Vec<_>>(), ["panic"]);
        let loud = scanned(&Corridor { rule: Rule::Logs }, &to_the_goal());
        assert_eq!(loud.seen.iter().map(|seen| seen.detector).collect::<Vec<_>>(), ["error-log"]);
    }

    fn set(settings: &[&str]) -> Checks {
        let settings = settings.iter().map(|text| (*text).to_owned()).collect();
        let choice = DetectorChoice { with: vec!["all".to_owned()], settings, ..DetectorChoice::default() };
        let detectors = Detectors::choose(&Corridor::default(), &choice).expect("there are such");
        Checks::default().with_detectors(&detectors)
    }

    #[test]
    fn only_settings_other_than_the_defaults_are_kept() {
        let game = Corridor::default();
        assert_eq!(set(&["stuck.ticks=20"]).settings_of(&game, "stuck"), ["stuck.ticks=20"]);
        for checks in [set(&["stuck.ticks=20"]), Checks::of_game(&game), Checks::default()] {
            assert!(checks.settings_of(&game, "frozen-world").is_empty());
        }
        let reset = set(&["stuck.ticks=20"]).with_detectors(&Detectors::defaults(&game));
        assert!(reset.settings_of(&game, "stuck").is_empty());
    }

    #[test]
    fn a_finding_is_looked_for_as_it_was_found_unless_somebody_says_otherwise() {
        // Walking against the end of the corridor changes nothing.
        let game = Corridor { rule: Rule::NoExit };
        let actions: Vec<ActionValue> = [1, 2].repeat(10).into_iter().map(ActionValue::Discrete).collect();
        let strict = set(&["frozen-world.ticks=8"]);
        let head = FindingHead::new("plain:3", "frozen-world", "nothing has changed");
        let default = Checks::of_game(&game);
        let found = |head: &FindingHead, checks: &Checks| {
            StoredFinding::of_actions(&game, "plain", 3, head.clone(), &actions, checks)
        };
        assert_eq!(found(&head, &default), None, "the default setting is larger than the episode");
        let head = FindingHead { settings: strict.settings_of(&game, "frozen-world"), ..head };
        assert_eq!(head.settings, ["frozen-world.ticks=8"]);
        let stored = found(&head, &strict).expect("nothing changes");
        let status = |checks: &Checks| recheck(&game, &stored, checks).expect("playable").status(&stored);
        assert_eq!(status(&default), FindingStatus::StillThere);
        assert_eq!(status(&set(&["frozen-world.ticks=100"])), FindingStatus::Gone, "somebody says otherwise");
        let as_default =
            default.records.iter().find_map(|record| record.strip_prefix("frozen-world ")).expect("it looks");
        let as_default = format!("frozen-world.{as_default}");
        assert_eq!(status(&set(&[&as_default])), FindingStatus::Gone, "also by saying the default");
        let unknown = FindingHead { settings: vec!["frozen-world.colour=4".to_owned()], ..head };
        assert!(found(&unknown, &strict).is_some(), "a setting that is no more is left aside");
    }
}

//! The scan of one episode's actions with all detectors.

use std::{cell::RefCell, rc::Rc, sync::Arc};

use bevy_playbot::{action::ActionValue, episode::EpisodeResult};

use super::{
    detected::Looking,
    moment::{Moment, Watcher},
    play::play_actions,
    solo::Setting,
};
use crate::{detectors::Detectors, game::Game};

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
pub(crate) fn scan(
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
    let watcher: Watcher = Box::new(move |moment: &Moment| {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        corridor::{Corridor, Rule, to_the_goal},
        detectors::DetectorChoice,
    };

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
}

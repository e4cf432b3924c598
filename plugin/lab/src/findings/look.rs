//! The replay of actions in search of a finding.

use std::sync::Arc;

use bevy_playbot::action::ActionValue;

use super::{
    check::Check,
    detected::watcher as detector_watcher,
    failure::message_of,
    head::FindingHead,
    play::{Replayed, play_actions},
    solo::Setting,
};
use crate::{
    detectors::ShownBy,
    game::{Game, level_designs},
    level_files::is_level_files,
};

/// The result of a replay.
pub(super) struct Look {
    /// Whether the finding is there.
    pub is_there: bool,
    /// Its tick, if it needs play.
    pub tick: Option<u32>,
    /// The replayed episode.
    pub replayed: Replayed,
    /// Its current message, if it is known.
    pub message: Option<String>,
}

/// Plays the actions, unless the check needs no play, and runs the check.
pub(super) fn look(setting: Setting, head: &FindingHead, actions: &[ActionValue], check: &Check) -> Look {
    match check {
        Check::Level(is_there) => in_level(setting, *is_there),
        Check::Episode(check) => {
            let found = in_episode(setting, actions, |replayed| check(head, replayed));
            let message = message_of(&head.detector, &found.replayed);
            Look { message, ..found }
        }
        Check::Ticks(watcher) => {
            let replayed = play_actions(setting, actions, Some(watcher(head)));
            let tick = replayed.noticed;
            Look { is_there: tick.is_some(), tick, replayed, message: None }
        }
        Check::Detector(detector) => {
            let (watcher, said) = detector_watcher(Arc::clone(detector));
            let replayed = play_actions(setting, actions, Some(watcher));
            let tick = replayed.noticed;
            Look { is_there: tick.is_some(), tick, replayed, message: said.take() }
        }
        Check::WholeLevel(detector) => match detector.shown_by() {
            ShownBy::Nothing => Look { is_there: false, tick: None, replayed: Replayed::default(), message: None },
            ShownBy::Level => in_level(setting, |game, mode, level| detector.is_in_level(game, mode, level)),
            ShownBy::Episode => in_episode(setting, actions, |replayed| {
                let end = replayed.end.filter(|end| detector.is_in_episode(end, head.tick))?;
                end.ticks.checked_sub(1)
            }),
        },
    }
}

/// Runs the check on the level, without play.
fn in_level(setting: Setting, is_there: impl Fn(&dyn Game, &str, u64) -> bool) -> Look {
    let Setting { game, mode, level, .. } = setting;
    let designs = is_level_files(mode).then(|| level_designs(game, mode).ok());
    let level_file = designs.flatten().and_then(|designs| designs.files().of(level).cloned());
    let replayed = Replayed { level_file, ..Replayed::default() };
    Look { is_there: is_there(game, mode, level), tick: None, replayed, message: None }
}

/// Plays, and runs the check on the result of the episode.
fn in_episode(setting: Setting, actions: &[ActionValue], tick: impl Fn(&Replayed) -> Option<u32>) -> Look {
    let replayed = play_actions(setting, actions, None);
    let tick = tick(&replayed);
    Look { is_there: tick.is_some(), tick, replayed, message: None }
}

//! Playing actions and looking for a finding.

use bevy_playbot::action::ActionValue;

use super::{
    check::Check,
    head::FindingHead,
    play::{Replayed, play_actions},
    solo::Setting,
};
use crate::{game::level_designs, level_files::is_level_files};

/// What was seen.
pub(super) struct Look {
    /// Whether the finding is there.
    pub is_there: bool,
    /// In which tick, if somebody had to play.
    pub tick: Option<u32>,
    /// What came of the episode.
    pub replayed: Replayed,
}

/// Plays the actions, unless the check needs nobody to play, and asks the check.
pub(super) fn look(setting: Setting, head: &FindingHead, actions: &[ActionValue], check: &Check) -> Look {
    match check {
        Check::Level(is_there) => {
            let Setting { game, mode, level, .. } = setting;
            let designs = is_level_files(mode).then(|| level_designs(game, mode).ok());
            let level_file = designs.flatten().and_then(|designs| designs.files().of(level).cloned());
            let replayed = Replayed { level_file, ..Replayed::default() };
            Look { is_there: is_there(game, mode, level), tick: None, replayed }
        }
        Check::Episode(check) => {
            let replayed = play_actions(setting, actions, None);
            let tick = check(head, &replayed);
            Look { is_there: tick.is_some(), tick, replayed }
        }
        Check::Ticks(watcher) => {
            let replayed = play_actions(setting, actions, Some(watcher(head)));
            let tick = replayed.noticed;
            Look { is_there: tick.is_some(), tick, replayed }
        }
    }
}

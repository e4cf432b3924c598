//! Files of findings.
//!
//! A file is a recording of one episode, in the format that all recordings have ([`bevy_playbot::demo::file`]): framed,
//! checksummed, and readable by every program that reads recordings. The head of the finding is the recording's note.

use std::{io, path::Path};

use bevy_playbot::{
    action::ActionValue,
    demo::file::{Decider, DemoEnd, DemoEpisode, DemoHeader, DemoReader, DemoWriter},
    episode::EpisodeEnd,
};
use playbot_learner::disk;
use serde::Deserialize;

use super::{
    actions::{listed, recorded},
    checks::Checks,
    error::{FindingError, io_error},
    head::{FindingHead, HEAD_FORMAT},
    look::{Look, look},
    play::Replayed,
    solo::Setting,
};
use crate::game::Game;

/// A finding with the actions that lead to it.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredFinding {
    /// Game, version, mode and kind of actions. The note is written from the head.
    pub header: DemoHeader,
    /// The description of the finding.
    pub head: FindingHead,
    /// The episode up to the tick of the finding; without ticks if the finding needs no play.
    pub episode: DemoEpisode,
}

/// The part of a head that is read before its form is known.
#[derive(Deserialize)]
struct FormOnly {
    finding: u32,
}

impl StoredFinding {
    /// Plays actions on a level and searches for the finding with its detector's check. Later ticks are cut off. The
    /// head gets tick, state hash and, if it is unknown, original length.
    ///
    /// `None` if the finding does not happen, or there is no check of that name.
    pub fn of_actions(
        game: &dyn Game,
        mode: &str,
        level: u64,
        head: FindingHead,
        actions: &[ActionValue],
        checks: &Checks,
    ) -> Option<Self> {
        let setting = Setting { game, mode, level, seed: head.seed };
        let Look { is_there, tick, replayed, .. } = look(setting, &head, actions, &checks.of_finding(game, &head)?);
        is_there.then(|| Self::of_replay(setting, head, actions, replayed, tick))
    }

    /// Creates a finding from replayed actions.
    pub(super) fn of_replay(
        setting: Setting,
        mut head: FindingHead,
        actions: &[ActionValue],
        replayed: Replayed,
        tick: Option<u32>,
    ) -> Self {
        let Setting { game, mode, level, .. } = setting;
        let ticks = tick.map_or(0, |tick| actions.len().min(tick as usize + 1));
        head.tick = tick;
        head.state_hash = tick.and_then(|tick| replayed.state_hash(tick));
        if head.original_ticks == 0 {
            head.original_ticks = u32::try_from(actions.len()).unwrap_or(u32::MAX);
        }
        let mut header = game.demo_header(mode);
        header.demonstrator = head.tester.clone().unwrap_or_default();
        let end = replayed.end.filter(|end| end.ticks as usize == ticks).map(|end| end.end);
        // A tick in which a game breaks has no reward and no state.
        let mut rewards: Vec<f32> =
            replayed.rewards.iter().map(|reward| if reward.is_finite() { *reward } else { 0.0 }).collect();
        rewards.resize(ticks, 0.0);
        let mut state_hashes = replayed.state_hashes;
        let last = state_hashes.last().copied().unwrap_or(0);
        state_hashes.resize(ticks, last);
        let mut episode = DemoEpisode::new(level, header.actions);
        episode.level_file = replayed.level_file;
        episode.actions = recorded(&actions[..ticks], &game.actions());
        episode.deciders = vec![Decider::Bot; ticks];
        (episode.rewards, episode.state_hashes) = (rewards, state_hashes);
        episode.end = match end {
            Some(EpisodeEnd::Terminated { success }) => DemoEnd::Terminated { success },
            Some(EpisodeEnd::Truncated) => DemoEnd::Truncated,
            None => DemoEnd::Aborted,
        };
        Self { header, head, episode }
    }

    /// Returns the actions, one for each tick.
    pub fn actions(&self) -> Vec<ActionValue> {
        listed(&self.episode.actions)
    }

    /// Reads a file.
    ///
    /// # Errors
    ///
    /// It is not a recording, damaged, or a recording without the head of a finding.
    pub fn read(path: &Path) -> Result<Self, FindingError> {
        let reader = DemoReader::open(path)?;
        let header = reader.header().clone();
        let head = head_of(path, &header)?;
        let mut episodes = reader.read_all()?;
        match (episodes.pop(), episodes.len()) {
            (Some(episode), 0) => Ok(Self { header, head, episode }),
            (last, others) => {
                Err(FindingError::Episodes { path: path.into(), episodes: others + usize::from(last.is_some()) })
            }
        }
    }

    /// Writes a file atomically, and replaces an existing one. The same finding gives the same bytes.
    ///
    /// # Errors
    ///
    /// The system cannot write.
    pub fn write(&self, path: &Path) -> Result<(), FindingError> {
        let fresh = disk::temporary_name(path);
        let written = self.write_new(&fresh).and_then(|()| disk::rename(&fresh, path).map_err(io_error("write", path)));
        if written.is_err() {
            // The first error is the one to report.
            let _ = disk::remove_file(&fresh);
        }
        written
    }

    fn write_new(&self, path: &Path) -> Result<(), FindingError> {
        let note = ron::ser::to_string(&self.head)
            .map_err(|error| io_error("write", path)(io::Error::other(error.to_string())))?;
        let mut writer = DemoWriter::replace(path, DemoHeader { note, ..self.header.clone() })?;
        writer.push(&self.episode)?;
        Ok(())
    }
}

fn head_of(path: &Path, header: &DemoHeader) -> Result<FindingHead, FindingError> {
    let DemoHeader { note, game, .. } = header;
    // The parser's message is useless here: notes of recordings are free text.
    let none = |_: ron::error::SpannedError| FindingError::NoFinding { path: path.into(), game: game.clone() };
    let FormOnly { finding } = ron::from_str(note).map_err(none)?;
    if finding > HEAD_FORMAT {
        return Err(FindingError::NewerForm { path: path.into(), found: finding, newest: HEAD_FORMAT });
    }
    ron::from_str(note).map_err(none)
}

#[cfg(test)]
mod tests;

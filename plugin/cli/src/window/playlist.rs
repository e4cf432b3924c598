//! The order of the levels in a window, and the result of the last episode.

use crate::window::deciders::Deciders;
use bevy::prelude::*;
use bevy_playbot::episode::EpisodeResult;
use playbot_harness::prelude::*;
use playbot_report::counted;

/// The levels of a session. A won level is followed by the next, a lost one comes again, and the first follows the
/// last.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug)]
pub struct Playlist {
    levels: LevelSplit,
    current: u64,
}

impl Playlist {
    /// Takes levels, and the first one to play.
    pub fn new(levels: LevelSplit, first: u64) -> Self {
        let current = first.clamp(levels.first, levels.last);
        Self { levels, current }
    }

    /// Returns the mode of the levels.
    pub fn mode(&self) -> &str {
        &self.levels.mode
    }

    /// Goes on to the next level.
    pub(super) fn advance(&mut self) {
        self.current = if self.current == self.levels.last { self.levels.first } else { self.current + 1 };
    }

    /// Returns the current level, as an agent's queue.
    pub(super) fn queue(&self) -> LevelQueue {
        LevelQueue::Always(self.current)
    }
}

pub(super) fn build(app: &mut App) {
    app.init_resource::<LastEpisode>().add_observer(note_end);
}

/// The last finished episode.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct LastEpisode(Option<EpisodeResult>);

impl LastEpisode {
    /// Describes its end.
    pub fn words(&self) -> Option<String> {
        let EpisodeResult { level, end, success, ticks, .. } = self.0?;
        let how = match end {
            EpisodeEnd::Terminated { success: true } => "won",
            EpisodeEnd::Terminated { success: false } => "lost",
            EpisodeEnd::Truncated if success => "reached the goal, time was up",
            EpisodeEnd::Truncated => "out of time",
        };
        Some(format!("level {level} {how} after {}", counted(u64::from(ticks), "tick")))
    }
}

/// Plays the next level after a won one, and any other again.
fn note_end(
    event: On<EpisodeEnded>,
    mut last: ResMut<LastEpisode>,
    mut playlist: ResMut<Playlist>,
    deciders: Res<Deciders>,
    mut queues: Query<&mut LevelQueue>,
) {
    if event.entity != deciders.agent {
        return;
    }
    last.0 = Some(event.result);
    if event.success {
        playlist.advance();
    }
    if let Ok(mut queue) = queues.get_mut(deciders.agent) {
        *queue = playlist.queue();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_the_last_level_comes_the_first() {
        let mut playlist = Playlist::new("hard:3..5".parse().expect("a split"), 4);
        let mut levels = Vec::new();
        for _ in 0..4 {
            levels.push(playlist.current);
            playlist.advance();
        }
        assert_eq!(levels, [4, 5, 3, 4]);
    }
}

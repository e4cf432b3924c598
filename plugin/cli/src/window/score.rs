//! Result of the last episode, and the next level.

use bevy::prelude::*;
use bevy_playbot::episode::EpisodeResult;
use playbot_lab::prelude::*;

use super::{Playlist, seats::Seats};

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
        Some(format!("level {level} {how} after {ticks} ticks"))
    }
}

/// Plays the next level after a won one, and any other again.
fn note_end(
    event: On<EpisodeEnded>,
    mut last: ResMut<LastEpisode>,
    mut playlist: ResMut<Playlist>,
    seats: Res<Seats>,
    mut queues: Query<&mut LevelQueue>,
) {
    last.0 = Some(event.result);
    if event.success {
        playlist.advance();
    }
    if let Ok(mut queue) = queues.get_mut(seats.agent) {
        *queue = playlist.queue();
    }
}

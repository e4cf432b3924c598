//! The window's title: level, tick, decider and state of the game.

use std::time::Duration;

use bevy::{ecs::schedule::ScheduleLabel, prelude::*, window::PrimaryWindow, winit::WINIT_WINDOWS};
use playbot_lab::prelude::*;

use super::{Playlist, pace::Pace, score::LastEpisode, seats::Seats};

/// Time for which a notice is shown.
const NOTICE: Duration = Duration::from_secs(3);

/// Writes the title in `schedule`.
pub(super) fn build(app: &mut App, game: &'static str, schedule: impl ScheduleLabel) {
    app.insert_resource(GameName(game))
        .init_resource::<Notice>()
        .add_systems(schedule, (age_notice, write_title).chain());
}

#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct GameName(&'static str);

/// A notice for the person.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct Notice {
    words: Option<&'static str>,
    age: Duration,
}

impl Notice {
    /// Shows these words for a while.
    pub fn say(&mut self, words: &'static str) {
        *self = Self { words: Some(words), age: Duration::ZERO };
    }
}

fn age_notice(clock: Res<Time<Real>>, mut notice: ResMut<Notice>) {
    if notice.words.is_some() {
        notice.age += clock.delta();
        if notice.age > NOTICE {
            notice.words = None;
        }
    }
}

/// Formats with as many decimals as needed, at most two.
fn to_cents(value: f64) -> String {
    // Adding 0 takes the sign from what rounds to nothing.
    ((value * 100.0).round() / 100.0 + 0.0).to_string()
}

fn write_title(
    game: Res<GameName>,
    playlist: Res<Playlist>,
    (pace, last, notice): (Res<Pace>, Res<LastEpisode>, Res<Notice>),
    recorder: Option<Res<Recorder>>,
    seats: Res<Seats>,
    agents: Query<(&Control, &Episode)>,
    mut window: Single<&mut Window, With<PrimaryWindow>>,
) {
    let Ok((control, episode)) = agents.get(seats.agent) else { return };
    let mut parts = vec![
        format!("{} {} {}", game.0, playlist.mode(), episode.level),
        format!("tick {}", episode.tick),
        seats.who(*control),
        format!("return {}", to_cents(episode.total_reward)),
    ];
    parts.extend(last.words());
    parts.push(match recorder {
        Some(recorder) => format!("recording, {} episodes", recorder.episodes()),
        None => "not recording".to_owned(),
    });
    if pace.is_paused() {
        parts.push("PAUSED".to_owned());
    }
    parts.extend(notice.words.map(str::to_owned));
    let title = parts.join(" · ");
    if window.title != title {
        window.title = title;
    }
}

/// Applies the title at once, in frames in which Bevy's own systems do not.
pub(super) fn show(window: Single<(Entity, &Window), With<PrimaryWindow>>) {
    let (entity, window) = *window;
    WINIT_WINDOWS.with_borrow(|windows| {
        if let Some(shown) = windows.get_window(entity) {
            shown.set_title(&window.title);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::to_cents;

    #[test]
    fn returns_have_no_more_decimals_than_they_need() {
        let values = [-17616.085180282593, 10.0, 2.5, -0.001, 0.1 + 0.2];
        assert_eq!(values.map(to_cents), ["-17616.09", "10", "2.5", "0", "0.3"]);
    }
}

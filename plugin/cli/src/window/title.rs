//! The window's title: level, tick, decider and state of the game.

use crate::window::{
    Playlist,
    notice::{Notice, age_notice},
    session::{Deciders, LastEpisode},
    teaching::Teaching,
};
use bevy::{
    app::{RunFixedMainLoop, RunFixedMainLoopSystems},
    ecs::schedule::ScheduleLabel,
    prelude::*,
    time::TimeSystems,
    window::PrimaryWindow,
    winit::WINIT_WINDOWS,
};
use bevy_playbot::{
    engine::{TappedKeys, run_observe_schedule},
    episode::Tick,
    vision::VisionSystems,
};
use playbot_harness::prelude::*;
use playbot_report::counted;
use std::time::Duration;

/// Writes the title in `schedule`.
pub(super) fn build(app: &mut App, game: &'static str, schedule: impl ScheduleLabel) {
    app.insert_resource(GameName(game))
        .init_resource::<Notice>()
        .add_systems(schedule, (age_notice, write_title).chain());
}

#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct GameName(&'static str);

/// Formats with as many decimals as needed, at most two.
fn to_cents(value: f64) -> String {
    // Adding 0 takes the sign from what rounds to nothing.
    ((value * 100.0).round() / 100.0 + 0.0).to_string()
}

fn write_title(
    game: Res<GameName>,
    playlist: Res<Playlist>,
    (pace, last, notice): (Res<Pace>, Res<LastEpisode>, Res<Notice>),
    (recorder, teaching): (Option<Res<Recorder>>, Option<Res<Teaching>>),
    deciders: Res<Deciders>,
    agents: Query<(&Control, &Episode)>,
    mut window: Single<&mut Window, With<PrimaryWindow>>,
) {
    let Ok((control, episode)) = agents.get(deciders.agent) else { return };
    let mut parts = vec![
        format!("{} {} {}", game.0, playlist.mode(), episode.level),
        format!("tick {}", episode.tick),
        deciders.decider_name(*control),
        format!("return {}", to_cents(episode.total_reward)),
    ];
    parts.extend(last.words());
    parts.push(match recorder {
        Some(recorder) => format!("recording, {}", counted(recorder.episodes(), "episode")),
        None => "not recording".to_owned(),
    });
    parts.extend(teaching.and_then(|teaching| teaching.words()));
    if pace.is_paused() {
        parts.push("PAUSED".to_owned());
    }
    parts.extend(notice.words().map(str::to_owned));
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

// Pauses of game time, and the picture after each tick.

/// Time for which the end of an episode stays visible.
const REST: Duration = Duration::from_millis(700);

pub(super) fn build_pace(app: &mut App) {
    app.init_resource::<Pace>()
        .init_resource::<OnlySync>()
        .add_observer(rest)
        .add_systems(First, keep_pace.before(TimeSystems))
        .add_systems(RunFixedMainLoop, show_tick.in_set(RunFixedMainLoopSystems::AfterFixedMainLoop))
        .configure_sets(ObserveSchedule, (VisionSystems::Render, VisionSystems::Compose).run_if(not(only_syncing)));
}

/// Pauses of game time.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct Pace {
    paused: bool,
    /// Time since start at which the rest after an episode is over.
    rest_until: Duration,
    /// The same where the clock rests as well: frames that are left of it.
    rest_frames: u32,
}

impl Pace {
    /// Pauses, or goes on.
    pub fn toggle_pause(&mut self) {
        self.paused = !self.paused;
    }

    /// Goes on at once.
    pub fn go_on(&mut self) {
        *self = Self::default();
    }

    /// Rests at the end of an episode, in a game of `hz` frames a second.
    pub fn rest_in_frames(&mut self, hz: f64) {
        self.rest_frames = (REST.as_secs_f64() * hz).ceil() as u32;
    }

    /// Returns true if the game stands still in this frame, for games whose ticks are frames.
    pub fn is_still_frame(&mut self) -> bool {
        if self.paused {
            return true;
        }
        let rests = self.rest_frames > 0;
        self.rest_frames = self.rest_frames.saturating_sub(1);
        rests
    }

    /// Returns true if the person has paused.
    pub fn is_paused(&self) -> bool {
        self.paused
    }
}

/// Shows the end of an episode for a moment: its level goes when the next tick begins.
fn rest(_: On<EpisodeEnded>, clock: Res<Time<Real>>, mut pace: ResMut<Pace>) {
    pace.rest_until = clock.elapsed() + REST;
}

fn keep_pace(
    clock: Res<Time<Real>>,
    pace: Res<Pace>,
    mut game_time: ResMut<Time<Virtual>>,
    mut tapped: ResMut<TappedKeys>,
) {
    let still = pace.paused || clock.elapsed() < pace.rest_until;
    match (still, game_time.is_paused()) {
        (true, false) => game_time.pause(),
        (false, true) => {
            game_time.unpause();
            tapped.clear();
        }
        _ => {}
    }
}

/// Set while the picture is updated for people only.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
struct OnlySync(bool);

fn only_syncing(only: Res<OnlySync>) -> bool {
    only.0
}

/// Updates the picture to the state after the tick. Agents observe before they act; people want to see the result.
fn show_tick(world: &mut World, mut shown: Local<Tick>) {
    let tick = *world.resource::<Tick>();
    if tick != *shown {
        *shown = tick;
        world.resource_mut::<OnlySync>().0 = true;
        run_observe_schedule(world);
        world.resource_mut::<OnlySync>().0 = false;
    }
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

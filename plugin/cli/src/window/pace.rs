//! Pauses of game time, and the picture after each tick.

use std::time::Duration;

use bevy::{
    app::{RunFixedMainLoop, RunFixedMainLoopSystems},
    prelude::*,
    time::TimeSystems,
};
use bevy_playbot::{keyboard::TappedKeys, tick::Tick, vision::VisionSystems};
use playbot_lab::prelude::*;

/// Time for which the end of an episode stays visible.
const REST: Duration = Duration::from_millis(700);

pub(super) fn build(app: &mut App) {
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
        world.run_schedule(ObserveSchedule);
        world.resource_mut::<OnlySync>().0 = false;
    }
}

//! Running a game without a window: as fast as it goes, one fixed tick at a time, never by the clock.

use std::time::Duration;

use bevy::{
    ecs::schedule::{Schedules, SingleThreadedExecutor},
    prelude::*,
    time::{TimePlugin, TimeUpdateStrategy},
};

use crate::{
    fault::{Fault, Faults},
    plugin::PlaybotPlugin,
};

/// Number of fixed ticks since the World began.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub struct Tick(pub u64);

pub(crate) fn count_tick(mut tick: ResMut<Tick>) {
    tick.0 += 1;
}

/// An app with time and [`PlaybotPlugin`], and nothing that needs a screen, a GPU or the clock.
///
/// Each [`tick`](PlaybotAppExt::tick) runs Bevy's whole `Main` schedule with exactly one fixed tick in it, so that a
/// game behaves as it does in a window.
pub fn headless_app() -> App {
    let mut app = App::new();
    app.add_plugins((TimePlugin, PlaybotPlugin));
    set_tick_rate(&mut app, 60.0);
    app
}

/// Sets the length of a fixed tick, in ticks per second of game time, and lets each update run one.
pub fn set_tick_rate(app: &mut App, hz: f64) {
    let step = set_fixed_step(app, hz);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(step.saturating_mul(2));
}

/// Sets the length of a fixed tick for an app that runs by the clock, and returns it.
///
/// No frame runs more than one tick: on a machine that is too slow to draw them all, the game slows down, and every tick
/// is still seen and played.
pub fn set_fixed_step(app: &mut App, hz: f64) -> Duration {
    let step = Duration::from_secs_f64(1.0 / hz);
    app.insert_resource(Time::<Fixed>::from_duration(step));
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(step);
    step
}

/// Finishes an app's plugins and takes its World, so that it can move to another thread.
///
/// Schedules are set to run on the thread that calls them: Bevy's own threads cost more than they bring in a World of
/// this size, and several Worlds side by side use the cores better.
pub fn into_world(mut app: App) -> World {
    app.finish();
    app.cleanup();
    for (_, schedule) in app.world_mut().resource_mut::<Schedules>().iter_mut() {
        schedule.set_executor(SingleThreadedExecutor::new());
    }
    std::mem::take(app.world_mut())
}

/// Runs one fixed tick.
///
/// # Errors
///
/// The first breach of contract of the game in this tick: see [`Faults`].
pub fn tick_world(world: &mut World) -> Result<(), Fault> {
    let before = *world.resource::<Tick>();
    world.resource_mut::<Faults>().set_caller(true);
    // The first run of the main schedule only starts the clock.
    for _ in 0..2 {
        world.run_schedule(Main);
        world.clear_trackers();
        if *world.resource::<Tick>() != before {
            break;
        }
    }
    let mut faults = world.resource_mut::<Faults>();
    faults.set_caller(false);
    faults.take()
}

/// Ticking an app by hand.
pub trait PlaybotAppExt {
    /// Runs one fixed tick.
    ///
    /// # Errors
    ///
    /// The first breach of contract of the game in this tick.
    fn tick(&mut self) -> Result<(), Fault>;

    /// Runs `n` fixed ticks.
    ///
    /// # Errors
    ///
    /// The first breach of contract of the game.
    fn ticks(&mut self, n: u64) -> Result<(), Fault> {
        (0..n).try_for_each(|_| self.tick())
    }
}

impl PlaybotAppExt for App {
    fn tick(&mut self) -> Result<(), Fault> {
        tick_world(self.world_mut())
    }
}

impl PlaybotAppExt for World {
    fn tick(&mut self) -> Result<(), Fault> {
        tick_world(self)
    }
}

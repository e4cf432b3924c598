//! Headless runs: no window, full speed, one fixed tick at a time, independent of the clock.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{headless::set_tick_rate, prelude::*};
//!
//! #[derive(Resource, Default)]
//! struct Metres(f32);
//!
//! let mut app = headless_app();
//! set_tick_rate(&mut app, 50.0);
//! app.init_resource::<Metres>()
//!     .add_systems(FixedUpdate, |time: Res<Time>, mut way: ResMut<Metres>| way.0 += 10.0 * time.delta_secs());
//! // One second of game time.
//! app.ticks(50).expect("no agent broke its contract");
//! assert!((app.world().resource::<Metres>().0 - 10.0).abs() < 1e-3);
//! ```
//!
//! # Bevy's default plugins without a screen
//!
//! ```
//! use bevy::{prelude::*, window::PrimaryWindow};
//! use bevy_playbot::{headless::HeadlessPlugins, prelude::*};
//!
//! let mut app = App::new();
//! app.add_plugins((HeadlessPlugins::default(), PlaybotPlugin { placement: TickPlacement::Frame }));
//! app.finish();
//! app.cleanup();
//! app.tick().expect("no agent broke its contract");
//! // The resources that games need are there.
//! let mut windows = app.world_mut().query_filtered::<&Window, With<PrimaryWindow>>();
//! assert_eq!(windows.single(app.world()).expect("one window").width(), 1280.0);
//! assert!(app.world().contains_resource::<ButtonInput<KeyCode>>());
//! assert!(app.world().contains_resource::<Assets<Image>>());
//! ```

use crate::{
    agent::Control,
    episode::{Episode, Tick},
    fault::{Fault, Faults},
    panics,
    placement::{FrameGate, TickPlacement},
    plugin::PlaybotPlugin,
    renewal, system_errors, systems,
};
use bevy::{
    app::{PanicHandlerPlugin, PluginGroupBuilder, TerminalCtrlCHandlerPlugin},
    ecs::schedule::{Schedules, SingleThreadedExecutor},
    prelude::*,
    time::{TimePlugin, TimeUpdateStrategy},
    window::{ExitCondition, WindowPlugin, WindowResolution},
};
use std::time::Duration;

/// Creates an app with time and [`PlaybotPlugin`] that needs no screen, GPU or clock.
///
/// Each [`tick`](PlaybotAppExt::tick) runs Bevy's whole `Main` schedule with exactly one fixed tick
/// in it, so the game behaves as it does in a window.
pub fn headless_app() -> App {
    let mut app = App::new();
    app.add_plugins((TimePlugin, PlaybotPlugin::default()));
    set_tick_rate(&mut app, 60.0);
    app
}

/// Sets the length of a fixed tick, in ticks per second of game time. Each update runs one tick.
pub fn set_tick_rate(app: &mut App, hz: f64) {
    let step = set_fixed_step(app, hz);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(step.saturating_mul(2));
}

/// Sets the length of a fixed tick for an app that runs by the clock, and returns it.
///
/// A frame runs at most one tick. On a machine that is too slow to draw every tick the game slows
/// down, and no tick is skipped.
pub fn set_fixed_step(app: &mut App, hz: f64) -> Duration {
    let step = Duration::from_secs_f64(1.0 / hz);
    app.insert_resource(Time::<Fixed>::from_duration(step));
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(step);
    step
}

/// Gives every frame the same length of game time: `hz` frames are one second. With a window, the
/// window limits the rate of drawing.
pub fn set_frame_rate(app: &mut App, hz: f64) {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / hz)));
}

/// Creates an app for games in which a frame is a tick, with all of Bevy but a screen. It has
/// [`HeadlessPlugins`], with or without a renderer, and
/// [`PlaybotPlugin`] under [`TickPlacement::Frame`].
pub fn headless_frame_app(plugins: PluginGroupBuilder, hz: f64) -> App {
    let mut app = App::new();
    app.add_plugins((plugins, PlaybotPlugin { placement: TickPlacement::Frame }));
    set_frame_rate(&mut app, hz);
    app
}

/// Finishes an app's plugins and takes its World, so that it can move to another thread.
///
/// Bevy's own threads cost more than they save in a World of this size. Several Worlds side by side
/// use the cores better: see [`run_on_one_thread`].
pub fn into_world(mut app: App) -> World {
    app.finish();
    app.cleanup();
    run_on_one_thread(app.world_mut());
    std::mem::take(app.world_mut())
}

/// Sets the schedules of a World to run on the calling thread. Call it before they run.
///
/// A system that cannot run, for instance because a resource does not exist, becomes a fault of the
/// next tick instead of a panic. Where ticks are frames, the game may leave the order of its
/// systems open, and the systems are ordered here.
pub fn run_on_one_thread(world: &mut World) {
    for (_, schedule) in world.resource_mut::<Schedules>().iter_mut() {
        schedule.set_executor(SingleThreadedExecutor::new());
    }
    if world.contains_resource::<FrameGate>() {
        systems::put_in_order(world);
    }
    system_errors::listen(world);
}

/// Runs one tick. Under [`TickPlacement::Frame`] this may take several frames, while a level is
/// being built. A World with a [`Renewal`](crate::renewal::Renewal) is replaced by a new one before an
/// episode begins in it.
///
/// # Errors
///
/// The first breach of contract of the game in this tick: see [`Faults`]. A panic, in Worlds with
/// [`PanicReports`](crate::panics::PanicReports).
pub fn tick_world(world: &mut World) -> Result<(), Fault> {
    if let Some(mut faults) = world.get_resource_mut::<Faults>() {
        faults.set_caller(true);
    }
    let ticked = panics::guard(world, run_frames);
    // A World that has panicked may have lost the note.
    if let Some(mut faults) = world.get_resource_mut::<Faults>() {
        faults.set_caller(false);
    }
    ticked
}

/// Frames of a level under construction that do not wait for the clock.
const QUICK_FRAMES: u32 = 60;

/// Runs frames up to and including the next tick.
fn run_frames(world: &mut World) -> Result<(), Fault> {
    let before = *world.resource::<Tick>();
    if renewal::renew_if_due(world)? {
        world.insert_resource(before);
    }
    system_errors::clear();
    for frame in 1.. {
        world.run_schedule(Main);
        world.clear_trackers();
        if let Some(failure) = system_errors::take() {
            world.resource_mut::<Faults>().report(failure);
        }
        world.resource_mut::<Faults>().take()?;
        // The first run of the main schedule only starts the clock.
        let waits = frame < 2 || is_loading(world);
        if *world.resource::<Tick>() != before || !waits {
            break;
        }
        if frame > QUICK_FRAMES {
            #[allow(
                clippy::disallowed_methods,
                reason = "what is loaded arrives by the clock; no tick passes meanwhile"
            )]
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    Ok(())
}

/// Returns whether an unfinished level of some agent keeps ticks from passing.
fn is_loading(world: &mut World) -> bool {
    if !world.contains_resource::<FrameGate>() {
        return false;
    }
    let mut agents = world.query::<(&Control, &Episode)>();
    agents.iter(world).any(|(control, episode)| control.is_active() && episode.is_loading())
}

/// Methods that tick an app by hand.
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

/// Bevy's `DefaultPlugins`, as this program is built with them, for a World without a screen.
/// Input, assets, states, text, meshes and materials are there, and a window of 1280 by 720 that
/// only the game sees. There is no event loop, and the renderer has no surface to draw on.
///
/// With Bevy's feature `bevy_winit`, it needs the feature `window` of this crate; with `bevy_render`, the feature
/// `camera`. A plugin can be left out only by its type. Leave out others with
/// [`disable`](bevy::app::PluginGroupBuilder::disable), as with any group.
#[derive(Clone, Copy, Debug, Default)]
pub struct HeadlessPlugins {
    /// True if pictures are drawn for agents that see through a camera.
    draws: bool,
}

impl HeadlessPlugins {
    /// Creates the plugins with a renderer that draws for [`CameraSensor`](crate::camera::CameraSensor)s.
    #[cfg(feature = "camera")]
    pub fn drawing() -> Self {
        Self { draws: true }
    }
}

impl PluginGroup for HeadlessPlugins {
    fn build(self) -> PluginGroupBuilder {
        let window = Window { resolution: WindowResolution::new(1280, 720), ..default() };
        let plugins =
            DefaultPlugins.build().disable::<PanicHandlerPlugin>().disable::<TerminalCtrlCHandlerPlugin>().set(
                WindowPlugin {
                    primary_window: Some(window),
                    exit_condition: ExitCondition::DontExit,
                    close_when_requested: false,
                    ..default()
                },
            );
        without_screen(plugins, self.draws)
    }
}

#[cfg(feature = "camera")]
fn without_screen(plugins: PluginGroupBuilder, draws: bool) -> PluginGroupBuilder {
    use bevy::render::{RenderPlugin, pipelined_rendering::PipelinedRenderingPlugin};
    let render_creation = if draws { crate::camera::drawing() } else { crate::camera::not_drawing() };
    let renderer = RenderPlugin { render_creation, synchronous_pipeline_compilation: true, ..default() };
    let plugins = without_event_loop(plugins.set(renderer))
        .add(crate::camera::RenderListPlugin)
        .add(crate::camera::NoScreenPlugin);
    if plugins.contains::<PipelinedRenderingPlugin>() { plugins.disable::<PipelinedRenderingPlugin>() } else { plugins }
}

#[cfg(not(feature = "camera"))]
fn without_screen(plugins: PluginGroupBuilder, _draws: bool) -> PluginGroupBuilder {
    without_event_loop(plugins)
}

#[cfg(feature = "window")]
fn without_event_loop(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    plugins.disable::<bevy::winit::WinitPlugin>()
}

#[cfg(not(feature = "window"))]
fn without_event_loop(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    plugins
}

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

mod bevy_parts;

use crate::{
    agent::{Agent, AgentOrder, Control},
    calls::GameCall,
    episode::{Episode, Tick, with_tick},
    fault::{Fault, Faults},
    loading::{deliver_between_frames, tasks_in_order, wait_for_assets, wait_for_tasks},
    panics,
    placement::{FrameGate, TickPlacement},
    plugin::PlaybotPlugin,
    renewal, system_errors, systems,
};
use bevy::{
    app::{PanicHandlerPlugin, PluginGroupBuilder, TaskPoolOptions, TaskPoolPlugin, TerminalCtrlCHandlerPlugin},
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
    allow_whole_frames(app.world_mut());
}

/// Lets the game's clock advance by the whole length that [`set_frame_rate`] gives to frames. Bevy cuts
/// steps of the clock that are longer than a limit, by default 250 ms.
///
/// [`set_frame_rate`] calls it. Call it again after plugins that insert a clock of their own.
pub fn allow_whole_frames(world: &mut World) {
    let Some(&TimeUpdateStrategy::ManualDuration(frame)) = world.get_resource() else { return };
    if let Some(mut clock) = world.get_resource_mut::<Time<Virtual>>()
        && clock.max_delta() < frame
    {
        clock.set_max_delta(frame);
    }
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
    if app.world().contains_resource::<FrameGate>() {
        deliver_between_frames(app.world_mut());
    }
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
    systems::mark_trees_on_one_thread(world);
    if world.contains_resource::<FrameGate>() {
        systems::put_in_order(world);
    }
    system_errors::listen(world);
}

/// Runs one tick. Under [`TickPlacement::Frame`] this may take several frames, while a level is
/// being built. After each of these frames it waits for assets that the game has asked for, so that
/// they are there in the next one however fast the machine is. In a World with
/// [`TasksEndWithFrames`](crate::loading::TasksEndWithFrames) it waits for the game's tasks as well. A World with a
/// [`Renewal`](crate::renewal::Renewal) is replaced by a new one before an episode begins in it.
///
/// # Errors
///
/// The first breach of contract of the game in this tick: see [`Faults`]. A panic, in Worlds with
/// [`PanicReports`](crate::panics::PanicReports).
pub fn tick_world(world: &mut World) -> Result<(), Fault> {
    if let Some(mut faults) = world.get_resource_mut::<Faults>() {
        faults.set_caller(true);
    }
    let call = GameCall::begin("playing", levels_in_play(world));
    let ticked = with_tick(|| panics::guard(world, run_frames));
    drop(call);
    // A World that has panicked may have lost the note.
    if let Some(mut faults) = world.get_resource_mut::<Faults>() {
        faults.set_caller(false);
    }
    ticked
}

/// Returns the levels of all running episodes.
fn levels_in_play(world: &World) -> impl Iterator<Item = u64> {
    let agents = world.get_resource::<AgentOrder>().map_or(&[][..], AgentOrder::entities);
    agents.iter().filter_map(|&agent| {
        let (control, episode) = (world.get::<Control>(agent)?, world.get::<Episode>(agent)?);
        let is_played = control.is_active() && (episode.is_running() || episode.is_loading());
        is_played.then_some(episode.level)
    })
}

/// Frames of a level under construction that do not wait for the clock.
const QUICK_FRAMES: u32 = 60;

/// Frames without a tick in which a game may let its clock stand or run slowly.
const PATIENT_FRAMES: u32 = 600;

/// Runs frames up to and including the next tick.
fn run_frames(world: &mut World) -> Result<(), Fault> {
    let before = *world.resource::<Tick>();
    if renewal::renew_if_due(world)? {
        world.insert_resource(before);
    }
    system_errors::clear();
    let mut obstacle = None;
    for frame in 1.. {
        world.run_schedule(Main);
        world.clear_trackers();
        if world.contains_resource::<FrameGate>() {
            // First, since tasks may ask for assets.
            wait_for_tasks(world);
            wait_for_assets(world);
        }
        if let Some(failure) = system_errors::take() {
            world.resource_mut::<Faults>().report(failure);
        }
        world.resource_mut::<Faults>().take()?;
        if *world.resource::<Tick>() != before {
            break;
        }
        // The first run of the main schedule only starts the clock.
        if frame < 2 {
            continue;
        }
        if !is_loading(world) {
            // A pause that the game ends by itself takes a few frames. Each of them without a tick would be played twice.
            obstacle = slow_clock(world).or(obstacle);
            match &obstacle {
                None => break,
                Some(why) if frame >= PATIENT_FRAMES => return Err(standstill(world, why)),
                Some(_) => {}
            }
        } else if frame > QUICK_FRAMES {
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

/// Returns the reason why a frame may have no tick, if ticks are fixed steps of a clock that stands or runs slowly.
fn slow_clock(world: &World) -> Option<String> {
    let is_by_hand = !matches!(world.get_resource(), None | Some(TimeUpdateStrategy::Automatic));
    if world.contains_resource::<FrameGate>() || !is_by_hand {
        return None;
    }
    let clock = world.get_resource::<Time<Virtual>>()?;
    let speed = clock.relative_speed_f64();
    match clock.is_paused() {
        true => Some("is paused".to_owned()),
        false => (speed < 1.0).then(|| format!("runs at {speed} of its speed")),
    }
}

/// Returns the fault of a game whose clock makes no fixed step any more.
fn standstill(world: &mut World, why: &str) -> Fault {
    let mut agents = world.query::<(&Agent, &Control, &Episode)>();
    let active = agents.iter(world).filter(|(_, control, _)| control.is_active());
    let first = active.min_by_key(|(agent, ..)| agent.index);
    let (place, tick) = match first {
        Some((agent, _, episode)) => (format!("{}: ", episode.moment(agent)), u64::from(episode.tick)),
        None => (String::new(), world.resource::<Tick>().0),
    };
    Fault(format!(
        "{place}no tick passes since tick {tick}: the game's clock (`Time<Virtual>`) {why}, and a tick is a fixed step of \
         this clock; leave the clock alone, and pause the game by a state or a resource that its systems ask for"
    ))
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
/// The first World of a program that logs nowhere sets up Bevy's log, and no other.
///
/// No feature of this crate has to match one of Bevy's. Leave out others with
/// [`disable`](bevy::app::PluginGroupBuilder::disable), as with any group.
#[derive(Clone, Copy, Debug, Default)]
pub struct HeadlessPlugins {
    /// True if pictures are drawn for agents that see through a camera.
    draws: bool,
    /// True if the renderer's sub-app exists while plugins are built, although it draws nothing.
    shows_sub_app: bool,
    /// True if the game's tasks run one after the other.
    orders_tasks: bool,
}

impl HeadlessPlugins {
    /// Creates the plugins with a renderer that draws for [`CameraSensor`](crate::camera::CameraSensor)s.
    #[cfg(feature = "camera")]
    pub fn drawing() -> Self {
        Self { draws: true, ..default() }
    }

    /// Lets plugins of the game find Bevy's `RenderApp` while they are built, for plugins that panic without it. What
    /// they add to it has no effect, since the sub-app is removed before plugins are finished. It makes a World slower to
    /// build.
    pub fn with_render_app(self) -> Self {
        Self { shows_sub_app: true, ..self }
    }

    /// Lets tasks of `AsyncComputeTaskPool` run one after the other, in the order in which they are spawned.
    pub fn with_tasks_in_order(self) -> Self {
        Self { orders_tasks: true, ..self }
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
        let plugins = bevy_parts::with_one_log(bevy_parts::without_devices(plugins))
            .set(one_thread_for_each_world(self.orders_tasks));
        if self.draws { drawing(plugins) } else { not_drawing(plugins, self.shows_sub_app) }
    }
}

/// Bevy's pools of threads, with one thread for work within a frame: its systems then loop on the thread of their World,
/// and so in the same order on every machine.
fn one_thread_for_each_world(orders_tasks: bool) -> TaskPoolPlugin {
    let mut options = TaskPoolOptions::default();
    (options.compute.min_threads, options.compute.max_threads) = (1, 1);
    if orders_tasks { tasks_in_order(options) } else { TaskPoolPlugin { task_pool_options: options } }
}

#[cfg(feature = "camera")]
fn drawing(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    let render_creation = crate::camera::drawing();
    let renderer = bevy::render::RenderPlugin { render_creation, synchronous_pipeline_compilation: true, ..default() };
    plugins.set(renderer).add(crate::camera::NoScreenPlugin)
}

#[cfg(not(feature = "camera"))]
fn drawing(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    plugins
}

fn not_drawing(plugins: PluginGroupBuilder, shows_sub_app: bool) -> PluginGroupBuilder {
    let plugins = bevy_parts::without_drawing(plugins, shows_sub_app);
    #[cfg(feature = "camera")]
    let plugins = plugins.add(crate::camera::NoScreenPlugin);
    plugins
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{calls::SlowCalls, level::LevelQueue};
    use playbot_learner::ActionSpace;

    /// Returns an app of fixed ticks, in which an agent plays level 7 and `system` runs in each of them.
    fn app_with<M>(system: impl IntoScheduleConfigs<bevy::ecs::system::ScheduleSystem, M>) -> App {
        let mut app = headless_app();
        app.add_systems(FixedUpdate, system);
        app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human, LevelQueue::Always(7)));
        app
    }

    #[test]
    fn frames_longer_than_a_quarter_of_a_second_count_in_full() {
        let mut app = App::new();
        app.add_plugins((TimePlugin, PlaybotPlugin { placement: TickPlacement::Frame }));
        set_frame_rate(&mut app, 2.0);
        app.ticks(20).expect("there is no agent");
        assert_eq!(app.world().resource::<Time<Virtual>>().elapsed(), Duration::from_secs(10));
    }

    /// The calls that a system sees in its own tick.
    #[derive(Resource, Default)]
    struct Seen(Vec<String>);

    #[test]
    fn a_tick_is_a_call_for_the_levels_that_are_played_and_begin() {
        let mut app = app_with(|mut seen: ResMut<Seen>| {
            let mut slow = SlowCalls::default();
            slow.look();
            seen.0 = slow.look().iter().map(ToString::to_string).collect();
        });
        app.init_resource::<Seen>();
        app.world_mut().spawn((Agent::new(1, ActionSpace::Discrete(2)), Control::Human, LevelQueue::Always(70_002)));
        for _tick in 0..2 {
            app.tick().expect("nothing is wrong");
            let seen = &app.world().resource::<Seen>().0;
            assert!(seen.iter().any(|call| call == "playing levels 7 and 70002"), "{seen:?}");
        }
        let mut slow = SlowCalls::default();
        slow.look();
        assert!(slow.look().iter().all(|call| !call.to_string().contains("70002")), "it has returned");
    }

    #[test]
    fn short_frames_leave_the_limit_of_the_clock_alone() {
        let mut app = App::new();
        app.add_plugins(TimePlugin);
        set_frame_rate(&mut app, 60.0);
        assert_eq!(app.world().resource::<Time<Virtual>>().max_delta(), Duration::from_millis(250));
    }

    #[test]
    fn a_paused_clock_is_a_fault_where_ticks_are_fixed_steps() {
        let mut app = app_with(|episodes: Query<&Episode>, mut clock: ResMut<Time<Virtual>>| {
            if episodes.iter().any(|episode| episode.tick == 2) {
                clock.pause();
            }
        });
        app.ticks(3).expect("the clock runs");
        for _ in 0..2 {
            let text = app.tick().expect_err("the clock is paused").to_string();
            let place = "agent 0, level 7, tick 3: no tick passes since tick 3: ";
            assert!(text.starts_with(place), "{text}");
            assert!(text.contains("the game's clock (`Time<Virtual>`) is paused"), "{text}");
        }
    }

    #[test]
    fn a_clock_of_speed_0_is_a_fault_where_ticks_are_fixed_steps() {
        let mut app = app_with(|mut clock: ResMut<Time<Virtual>>| clock.set_relative_speed(0.0));
        app.tick().expect("the clock runs");
        let text = app.tick().expect_err("the clock stands").to_string();
        assert!(text.contains("since tick 1: the game's clock (`Time<Virtual>`) runs at 0 of its speed"), "{text}");
    }

    #[test]
    fn slow_motion_takes_more_frames_for_each_fixed_tick() {
        let mut app = app_with(|mut clock: ResMut<Time<Virtual>>| clock.set_relative_speed(0.25));
        for tick in 1..=9 {
            app.tick().expect("the clock runs");
            assert_eq!(*app.world().resource::<Tick>(), Tick(tick));
        }
    }

    #[test]
    fn a_pause_that_the_game_ends_by_itself_is_no_fault() {
        let mut app = app_with(|mut clock: ResMut<Time<Virtual>>| clock.pause());
        app.add_systems(Update, |mut clock: ResMut<Time<Virtual>>, mut frames: Local<u32>| {
            *frames += u32::from(clock.is_paused());
            if *frames == 5 {
                *frames = 0;
                clock.unpause();
            }
        });
        for tick in 1..=3 {
            app.tick().expect("the pause ends");
            assert_eq!(*app.world().resource::<Tick>(), Tick(tick));
        }
    }
}

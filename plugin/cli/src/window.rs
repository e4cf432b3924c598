//! A window in which a person plays, and hands over to a policy or a bot and back.
//!
//! The game runs as it does without a window. Its rules, the recorder and the policy see fixed ticks only, so its
//! recordings replay headless. The window adds a clock, a keyboard and a camera. The feature `view3d` adds a view in
//! space for games that have one.
//!
//! Games whose ticks are frames draw themselves, and are shown as they are. A person's keys there become an action
//! first, which then presses the game's keys as a bot's would. The game therefore sees no input that the recording
//! lacks. In games with other inputs, this is so for a recording; otherwise they see the devices as they are.
//!
//! The folder, in reading order:
//!
//! - `session`: the deciders in a window, who are the person and the autopilot; the order of the levels, and the result of
//!   the last episode.
//! - `keys`: the window's own keys; `devices`: the person's devices, kept from the game or handed on to it.
//! - `camera`: the person's view from above; `solid`: the view in space.
//! - `overlay`: what the agent does, over the picture.
//! - `teaching`: F9 and F10, recordings and lessons.
//! - `notice`: notices in the title, and keys of the person that no action holds; `title`: the window's title, and pauses
//!   of game time.
//! - `frames`: windows of games whose ticks are frames.
//! - `ending`: the orderly end, after which the recording is whole, and errors of opening and running.

mod camera;
mod devices;
mod ending;
mod frames;
mod keys;
mod notice;
mod overlay;
mod session;
#[cfg(feature = "view3d")]
mod solid;
mod teaching;
mod title;

use crate::window::{
    ending::{Verdict, catch},
    session::Deciders,
    teaching::Teaching,
};
use bevy::{
    app::{PanicHandlerPlugin, PluginGroupBuilder, TerminalCtrlCHandlerPlugin},
    prelude::*,
    window::{ExitCondition, PresentMode, WindowResolution},
    winit::{UpdateMode, WinitSettings},
};
use bevy_playbot::{
    camera::TileLayerPlugin,
    demo::{
        file::{DemoEpisode, DemoWriter},
        recorder::Recorder,
    },
    engine::{PressesForPeople, panics},
    episode::NoTimeLimit,
    headless::{set_fixed_step, set_frame_rate},
    key_bindings::{KeyBindings, KeyboardPlugin, MissingSet},
    overlay::OverlayNames,
    placement::TickPlacement,
    skill_prior::NamedSkill,
    virtual_input::VirtualInput,
    vision::{ObservationConfig, VisionError},
};
use playbot_harness::{
    prelude::*,
    worlds::{add_game, build_panic, spawn_agents},
};
use std::time::Duration;

pub use crate::window::{
    ending::WindowError,
    notice::UnboundKeys,
    session::{Autopilot, Playlist},
    teaching::TeachingSetup,
};

/// Width and height of the window at first: eleven pixels for each of the bots' 64.
const SIDE: u32 = 704;

/// Longest time between two frames. Frames have their own rate, and ticks another.
const FRAME: Duration = Duration::from_micros(16_667);

/// A window that is ready to run.
pub struct GameWindow {
    app: App,
    agent: Entity,
    /// The game, if a person's actions in it cannot be recorded.
    unrecorded: Option<&'static str>,
    unbound: UnboundKeys,
}

impl GameWindow {
    /// Prepares the window, which appears when it runs.
    ///
    /// # Errors
    ///
    /// No display, no means of drawing, or a game whose ticks are no frames, without keys or a picture.
    pub fn open(setup: WindowSetup) -> Result<Self, WindowError> {
        setup.observation_config.check(setup.game)?;
        match setup.game.tools().host.placement() {
            TickPlacement::Fixed => Self::with_our_camera(setup),
            TickPlacement::Frame => Self::as_it_is(setup),
        }
    }

    /// Builds the window of a game that this crate draws.
    fn with_our_camera(setup: WindowSetup) -> Result<Self, WindowError> {
        let WindowSetup { game, playlist, autopilot, observation_config, seed, stop } = setup;
        let keys = game.tools().input.key_bindings().ok_or(WindowError::NoKeys(game.name()))?;
        let picture = game.tools().pictures.picture().ok_or(VisionError::NoPicture { game: game.name() })?;
        let resolution = WindowResolution::new(SIDE, SIDE);
        let window = Window { title: game.name().to_owned(), resolution, ..default() };
        let mut app = bevy_app(window, |plugins| plugins.set(ImagePlugin::default_nearest()))?;
        set_pace(&mut app, UpdateMode::reactive(FRAME), UpdateMode::reactive_low_power(FRAME));
        app.add_plugins((PlaybotPlugin::default(), KeyboardPlugin, TileLayerPlugin));
        set_fixed_step(&mut app, game.tick_hz());
        add(game, &mut app, playlist.mode(), &observation_config, seed)?;
        if !observation_config.is_image() {
            // Sensors of pictures have added it already.
            game.tools().pictures.build_picture(&mut app);
        }
        let agent = seat(&mut app, game, &observation_config, autopilot, playlist);
        app.world_mut().entity_mut(agent).insert(keys);
        camera::build(&mut app, picture.width);
        let has_space_view = game.tools().pictures.has_space_view();
        #[cfg(feature = "view3d")]
        if has_space_view {
            crate::window::solid::build(&mut app, game);
        }
        ending::build(&mut app, stop);
        session::build_own_keys(&mut app);
        keys::build(&mut app);
        if has_space_view && cfg!(not(feature = "view3d")) {
            keys::excuse_view(&mut app);
        }
        title::build_pace(&mut app);
        session::build_last_episode(&mut app, game.tools().host.time_limit());
        title::build(&mut app, game.name(), Update);
        overlay::build(&mut app, game, agent);
        let unbound = UnboundKeys::new(game);
        notice::build(&mut app, unbound.clone());
        Ok(Self { app, agent, unrecorded: None, unbound })
    }

    /// Builds the window of a game that draws itself, and whose ticks are frames. The window is like its headless one.
    fn as_it_is(setup: WindowSetup) -> Result<Self, WindowError> {
        let WindowSetup { game, playlist, autopilot, observation_config, seed, stop } = setup;
        let window = Window {
            title: game.name().to_owned(),
            resolution: WindowResolution::new(1280, 720),
            // Positions may depend on the size.
            resizable: false,
            // The frames of the game have a rate of their own.
            present_mode: PresentMode::AutoNoVsync,
            ..default()
        };
        let mut app = bevy_app(window, |plugins| game.tools().host.windowed_plugins(plugins))?;
        app.add_plugins(PlaybotPlugin { placement: TickPlacement::Frame });
        add(game, &mut app, playlist.mode(), &observation_config, seed)?;
        let hz = game.tick_hz();
        set_frame_rate(&mut app, hz);
        // Only the clock starts a frame.
        let wait = Duration::from_secs_f64(1.0 / hz);
        let by_the_clock = UpdateMode::Reactive {
            wait,
            react_to_device_events: false,
            react_to_user_events: false,
            react_to_window_events: false,
        };
        set_pace(&mut app, by_the_clock, by_the_clock);
        let agent = seat(&mut app, game, &observation_config, autopilot, playlist);
        let keys = game.tools().input.key_bindings();
        let is_recorded = keys.is_some() || game.tools().input.records_people();
        let unrecorded = (!is_recorded).then_some(game.name());
        if let Some(keys) = keys {
            app.world_mut().entity_mut(agent).insert((keys, PressesForPeople));
        }
        ending::build(&mut app, stop);
        frames::build(&mut app, game.name(), hz);
        session::build_last_episode(&mut app, game.tools().host.time_limit());
        overlay::build(&mut app, game, agent);
        let unbound = UnboundKeys::new(game);
        notice::build(&mut app, unbound.clone());
        Ok(Self { app, agent, unrecorded, unbound })
    }

    /// Checks that a person's actions can be recorded.
    ///
    /// # Errors
    ///
    /// The game's actions are passed on by a system of its own.
    pub fn check_recording(&self) -> Result<(), WindowError> {
        self.unrecorded.map_or(Ok(()), |game| Err(WindowError::NotRecorded(game)))
    }

    /// Returns the keys that a person holds in this window without an action for them, up to the time of asking.
    pub fn unbound_keys(&self) -> UnboundKeys {
        self.unbound.clone()
    }

    /// Prints these lines once the game has started: its first panic comes before them.
    pub fn announce(&mut self, lines: Vec<String>) {
        let mut lines = Some(lines);
        self.app.add_systems(PostStartup, move || lines.take().iter().flatten().for_each(|line| report!("{line}")));
    }

    /// Lifts the time limit of the game's adapter.
    pub fn lift_time_limit(&mut self) {
        self.app.world_mut().entity_mut(self.agent).insert(NoTimeLimit);
    }

    /// Records every episode from now on, of any decider. What a person does then reaches the game as its actions only.
    pub fn record(&mut self, writer: DemoWriter) {
        record_into(self.app.world_mut(), self.agent, writer);
    }

    /// Names regions of the autopilot's skills.
    pub fn name_skills(&mut self, regions: Vec<NamedSkill>) {
        if let Some(mut names) = self.app.world_mut().get_mut::<OverlayNames>(self.agent) {
            names.skills = regions;
        }
    }

    /// Lets F9 record, and F10 learn from it.
    pub fn teach(&mut self, setup: TeachingSetup) {
        self.app.insert_resource(Teaching::new(setup, self.unrecorded));
    }

    /// Plays this episode first. After its end the person plays on.
    pub fn replay(&mut self, episode: DemoEpisode) {
        frames::build_replayed(&mut self.app, self.agent, episode);
    }

    /// Plays until the window is closed.
    ///
    /// # Errors
    ///
    /// The game broke its contract, a recording could not be written, or the window system gave up.
    pub fn run(mut self) -> Result<(), WindowError> {
        let verdict = self.app.world().resource::<Verdict>().clone();
        match catch(|| self.app.run()) {
            Err(panic) => Err(panic.into()),
            Ok(exit) => verdict.take(exit),
        }
    }
}

/// Setup of a window: game, levels and autopilot.
pub struct WindowSetup<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Its levels.
    pub playlist: Playlist,
    /// The player that takes over with Tab.
    pub autopilot: Option<Autopilot>,
    /// The autopilot's observation.
    pub observation_config: ObservationConfig,
    /// Random seed of the autopilot's draws.
    pub seed: u64,
    /// Returns true when the window must close; called every frame.
    pub stop: fn() -> bool,
}

/// Records every episode of the agent from its next one on.
fn record_into(world: &mut World, agent: Entity, writer: DemoWriter) {
    world.insert_resource(Recorder::new(writer));
    let mut agent = world.entity_mut(agent);
    agent.insert(Recording::default());
    // Windows of games that are drawn here turn keys into actions by themselves.
    if agent.contains::<VirtualInput>() && !agent.contains::<KeyBindings>() {
        agent.insert((PressesForPeople, MissingSet::default()));
    }
}

/// Adds the game and the autopilot's sensors. A panic of the game is its fault.
fn add(
    game: &dyn Game,
    app: &mut App,
    mode: &str,
    observation_config: &ObservationConfig,
    seed: u64,
) -> Result<(), WindowError> {
    let added = panics::hear(|| add_game(game, app, mode, observation_config, seed));
    Ok(added.map_err(|words| build_panic(game, &words))??)
}

/// Prepares the agent under a person's control, and the autopilot.
fn seat(
    app: &mut App,
    game: &dyn Game,
    observation_config: &ObservationConfig,
    autopilot: Option<Autopilot>,
    playlist: Playlist,
) -> Entity {
    let agent = spawn_agents(game, app.world_mut(), observation_config, 0, 1)[0];
    let deciders = Deciders::new(game, app.world_mut(), agent, autopilot);
    app.world_mut().entity_mut(agent).insert((Control::Human, playlist.queue()));
    app.insert_resource(deciders).insert_resource(playlist);
    agent
}

/// Sets the times of frames, with and without keyboard focus.
fn set_pace(app: &mut App, focused_mode: UpdateMode, unfocused_mode: UpdateMode) {
    app.insert_resource(WinitSettings { focused_mode, unfocused_mode });
}

/// Makes a Bevy app with a window, without log output and without its own ways of stopping. `change` comes before
/// the window.
fn bevy_app(window: Window, change: impl FnOnce(PluginGroupBuilder) -> PluginGroupBuilder) -> Result<App, WindowError> {
    let no_display = std::env::var_os("DISPLAY").is_none_or(|display| display.is_empty());
    if cfg!(target_os = "linux") && no_display {
        return Err(WindowError::NoDisplay("DISPLAY is not set".to_owned()));
    }
    let window = WindowPlugin {
        primary_window: Some(Window { name: Some("playbot".to_owned()), ..window }),
        // A recording is finished first: see `ending`.
        exit_condition: ExitCondition::DontExit,
        close_when_requested: false,
        ..default()
    };
    let mut app = App::new();
    // Bevy's plugins panic where there is no display or no adapter.
    catch(|| {
        let plugins = change(DefaultPlugins.build());
        let plugins = plugins.set(window).disable::<PanicHandlerPlugin>().disable::<TerminalCtrlCHandlerPlugin>();
        app.add_plugins(plugins);
    })?;
    Ok(app)
}

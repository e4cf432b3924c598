//! Putting the window together.

use bevy::{
    app::{PanicHandlerPlugin, TerminalCtrlCHandlerPlugin},
    prelude::*,
    window::{ExitCondition, WindowResolution},
    winit::{UpdateMode, WinitSettings},
};
use bevy_playbot::{
    camera::TileLayerPlugin,
    demo::{file::DemoWriter, recorder::Recorder},
    headless::set_fixed_step,
    keyboard::KeyboardPlugin,
    vision::{ObservationConfig, VisionError},
};
use playbot_lab::prelude::*;
use playbot_lab::worlds::{add_game, spawn_agents};

use super::{
    Partner, Playlist, WindowError, camera,
    ending::{self, Verdict},
    error::catch,
    keys, pace, score,
    seats::Seats,
    title,
};

/// Width and height of the window at first: eleven pixels for each of the bots' 64.
const SIDE: u32 = 704;
/// Longest time between two frames. Frames are drawn for the eye; ticks have their own rate.
const FRAME: std::time::Duration = std::time::Duration::from_micros(16_667);

/// What is played in a window, and who plays beside the person.
pub struct WindowSetup<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Its levels.
    pub playlist: Playlist,
    /// Who takes over when the person presses Tab.
    pub partner: Option<Partner>,
    /// What the partner sees.
    pub sight: ObservationConfig,
    /// Seed of the partner's draws.
    pub seed: u64,
    /// Whether somebody outside the window wants it closed; asked every frame.
    pub stop: fn() -> bool,
}

/// A window that is ready to run.
pub struct GameWindow {
    app: App,
    agent: Entity,
}

impl GameWindow {
    /// Prepares the window; it is seen when it runs.
    ///
    /// # Errors
    ///
    /// No display, nothing that can draw, or a game without keys or a picture.
    pub fn open(setup: WindowSetup) -> Result<Self, WindowError> {
        let WindowSetup { game, playlist, partner, sight, seed, stop } = setup;
        let keys = game.key_bindings().ok_or(WindowError::NoKeys(game.name()))?;
        let picture = game.picture().ok_or(VisionError::NoPicture { game: game.name() })?;
        sight.check(game)?;
        let mut app = bevy_app(game.name())?;
        app.add_plugins((PlaybotPlugin::default(), KeyboardPlugin, TileLayerPlugin));
        set_fixed_step(&mut app, game.tick_hz());
        add_game(game, &mut app, playlist.mode(), &sight, seed)?;
        if !sight.is_image() {
            // Those who see pictures have brought it already.
            game.build_picture(&mut app);
        }
        let agent = spawn_agents(game, app.world_mut(), &sight, 0, 1)[0];
        let seats = Seats::new(game, app.world_mut(), agent, partner);
        app.world_mut().entity_mut(agent).insert((Control::Human, keys, playlist.queue()));
        app.insert_resource(seats).insert_resource(playlist);
        camera::build(&mut app, picture.width);
        let has_space_view = game.has_space_view();
        #[cfg(feature = "view3d")]
        if has_space_view {
            super::solid::build(&mut app, game);
        }
        ending::build(&mut app, stop);
        keys::build(&mut app);
        if has_space_view && cfg!(not(feature = "view3d")) {
            keys::excuse_view(&mut app);
        }
        pace::build(&mut app);
        score::build(&mut app);
        title::build(&mut app, game.name());
        Ok(Self { app, agent })
    }

    /// Records every episode from now on, whoever decides.
    pub fn record(&mut self, writer: DemoWriter) {
        self.app.insert_resource(Recorder::new(writer));
        self.app.world_mut().entity_mut(self.agent).insert(Recording::default());
    }

    /// Plays until the window is closed.
    ///
    /// # Errors
    ///
    /// The game broke its contract, a recording could not be written, or the window system gave up.
    pub fn run(mut self) -> Result<(), WindowError> {
        let verdict = self.app.world().resource::<Verdict>().clone();
        match catch(|| self.app.run()) {
            Err(words) => Err(WindowError::of_panic(words)),
            Ok(exit) => verdict.take(exit),
        }
    }
}

/// Bevy with a window, silent and without its own ways of stopping.
fn bevy_app(title: &str) -> Result<App, WindowError> {
    let no_display = std::env::var_os("DISPLAY").is_none_or(|display| display.is_empty());
    if cfg!(target_os = "linux") && no_display {
        return Err(WindowError::NoDisplay("DISPLAY is not set".to_owned()));
    }
    let window = WindowPlugin {
        primary_window: Some(Window {
            title: title.to_owned(),
            name: Some("playbot".to_owned()),
            resolution: WindowResolution::new(SIDE, SIDE),
            ..default()
        }),
        // A recording is finished first: see `ending`.
        exit_condition: ExitCondition::DontExit,
        close_when_requested: false,
        ..default()
    };
    let plugins = DefaultPlugins
        .set(window)
        .set(ImagePlugin::default_nearest())
        .disable::<PanicHandlerPlugin>()
        .disable::<TerminalCtrlCHandlerPlugin>();
    let mut app = App::new();
    // Bevy's plugins panic where there is no display or no adapter.
    catch(|| {
        app.add_plugins(plugins);
    })
    .map_err(WindowError::of_panic)?;
    app.insert_resource(WinitSettings {
        focused_mode: UpdateMode::reactive(FRAME),
        unfocused_mode: UpdateMode::reactive_low_power(FRAME),
    });
    Ok(app)
}

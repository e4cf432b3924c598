//! Bevy's default plugins without a screen.
//!
//! ```
//! use bevy::{prelude::*, window::PrimaryWindow};
//! use bevy_playbot::{headless_plugins::HeadlessPlugins, prelude::*};
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

use bevy::{
    app::{PanicHandlerPlugin, PluginGroupBuilder, TerminalCtrlCHandlerPlugin},
    prelude::*,
    window::{ExitCondition, WindowPlugin, WindowResolution},
};

use crate::no_screen::NoScreenPlugin;

/// Bevy's `DefaultPlugins`, as this program is built with them, for a World without a screen.
/// Input, assets, states, text, meshes and materials are there, and a window of 1280 by 720 that
/// only the game sees. There is no event loop, and the renderer has no surface to draw on.
///
/// With Bevy's feature `bevy_winit`, it needs the feature `window` of this crate; with
/// `bevy_render`, the feature `camera`: a plugin can be left out only by its type. Leave out others
/// with [`disable`](bevy::app::PluginGroupBuilder::disable), as with any group.
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
        without_screen(plugins, self.draws).add(NoScreenPlugin)
    }
}

#[cfg(feature = "camera")]
fn without_screen(plugins: PluginGroupBuilder, draws: bool) -> PluginGroupBuilder {
    use bevy::render::{RenderPlugin, pipelined_rendering::PipelinedRenderingPlugin};
    let render_creation = if draws { crate::camera::drawing() } else { crate::camera::not_drawing() };
    let renderer = RenderPlugin { render_creation, synchronous_pipeline_compilation: true, ..default() };
    let plugins = without_event_loop(plugins.set(renderer)).add(crate::camera::RenderListPlugin);
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

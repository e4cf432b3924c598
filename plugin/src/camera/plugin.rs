//! The plugin.

use bevy::{
    prelude::*,
    render::{RenderApp, RenderPlugin},
};

use super::{
    ReadbackDelay, TileLayerPlugin, adapter,
    borrow::BorrowedTargets,
    fill_frames::fill_frames,
    images,
    prepare::Atlas,
    readback::Readback,
    renderer::{self, Renderer},
    scene_schedule::add_renderer,
    sensor_view::{SensorViews, Stamp},
    sensor_view_draw,
};
use crate::{
    no_screen::NoScreen,
    systems::ObserveSchedule,
    vision::{VisionError, VisionPlugin, VisionSystems},
};

/// Adds [`CameraSensor`](super::CameraSensor)s to a game.
///
/// In an app without a renderer, [`headless`](Self::headless) brings Bevy's along. In a game with a window, add the
/// plugin, either way, after `DefaultPlugins`, whose `PipelinedRenderingPlugin` must be disabled where it exists (Bevy's
/// feature `multi_threaded`): the plugin runs the renderer itself, for sensors in the middle of a tick and for windows in
/// `Last`.
#[derive(Clone, Debug, Default)]
pub struct CameraSensorPlugin {
    headless: bool,
}

/// The app has a renderer of its own, and windows that it draws.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct ShowsWindows;

impl CameraSensorPlugin {
    /// For an app without a window: brings along what the renderer needs, as far as the app does not have it.
    ///
    /// # Errors
    ///
    /// [`VisionError::NoAdapter`].
    pub fn headless() -> Result<Self, VisionError> {
        adapter::check()?;
        Ok(Self { headless: true })
    }

    /// For an app with or without a window, whichever it is: only one without a renderer gets one.
    ///
    /// # Errors
    ///
    /// [`VisionError::NoAdapter`].
    pub fn for_app(app: &App) -> Result<Self, VisionError> {
        if app.get_sub_app(RenderApp).is_some() { Ok(Self::default()) } else { Self::headless() }
    }
}

impl Plugin for CameraSensorPlugin {
    fn build(&self, app: &mut App) {
        if app.is_plugin_added::<RenderPlugin>() && !app.world().contains_resource::<NoScreen>() {
            app.add_systems(Last, renderer::draw_windows);
            app.insert_resource(ShowsWindows);
        }
        if self.headless {
            add_renderer(app, adapter::creation());
        } else if !app.is_plugin_added::<TileLayerPlugin>() && app.get_sub_app(RenderApp).is_some() {
            app.add_plugins(TileLayerPlugin);
        }
        VisionPlugin::add_to(app);
        sensor_view_draw::add_sensor_views(app);
        app.init_resource::<ReadbackDelay>()
            .init_resource::<Atlas>()
            .init_resource::<BorrowedTargets>()
            .init_resource::<SensorViews>()
            .init_resource::<Stamp>()
            .init_resource::<Readback>()
            .init_resource::<images::MissingImages>()
            // It reads whatever can be drawn; what a game changes in `Sync` or before is seen.
            .add_systems(ObserveSchedule, fill_frames.in_set(VisionSystems::Render).ambiguous_with_all());
    }

    fn cleanup(&self, app: &mut App) {
        adapter::keep_memory();
        let shows_windows = app.world().contains_resource::<ShowsWindows>();
        if let Some(renderer) = Renderer::take(app, shows_windows) {
            app.insert_resource(renderer);
        }
    }
}

//! The plugin of [`CameraSensor`](super::CameraSensor)s.

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
/// In an app without a renderer, [`headless`](Self::headless) adds Bevy's. In a game with a window, add the plugin
/// after `DefaultPlugins` and disable `PipelinedRenderingPlugin` if it exists (Bevy's feature `multi_threaded`). The
/// plugin runs the renderer itself: for sensors in the middle of a tick, for windows in `Last`.
#[derive(Clone, Debug, Default)]
pub struct CameraSensorPlugin {
    headless: bool,
}

/// Marks an app with its own renderer, which draws windows.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct ShowsWindows;

impl CameraSensorPlugin {
    /// Creates the plugin for an app without a window. It adds the parts of the renderer that the app lacks.
    ///
    /// # Errors
    ///
    /// [`VisionError::NoAdapter`].
    pub fn headless() -> Result<Self, VisionError> {
        adapter::check()?;
        Ok(Self { headless: true })
    }

    /// Creates the plugin for an app with or without a window. It adds a renderer only if the app has none.
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
            // It reads everything that can be drawn; changes made in `Sync` or before are seen.
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

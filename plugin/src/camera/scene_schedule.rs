//! Bevy's systems after `Update` that prepare a scene for drawing, to be run in the middle of a tick.

use bevy::{
    app::TaskPoolPlugin,
    asset::{AssetEventSystems, AssetPlugin},
    camera::CameraPlugin,
    core_pipeline::CorePipelinePlugin,
    diagnostic::FrameCountPlugin,
    ecs::schedule::{Schedules, SingleThreadedExecutor},
    image::ImagePlugin,
    mesh::MeshPlugin,
    prelude::*,
    render::{RenderPlugin, extract_plugin::ExtractPlugin, settings::RenderCreation},
    sprite::SpritePlugin,
    sprite_render::SpriteRenderPlugin,
    text::TextPlugin,
    transform::TransformPlugin,
    window::{ExitCondition, WindowPlugin},
};

use super::{TileLayerPlugin, adapter, images};

/// Adds the parts of the renderer that the app lacks.
pub(super) fn add_renderer(app: &mut App, render_creation: RenderCreation) {
    add(app, TaskPoolPlugin::default());
    add(app, FrameCountPlugin);
    add(app, TransformPlugin);
    let closed = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
    add(app, closed);
    add(app, AssetPlugin::default());
    add(app, RenderPlugin { render_creation, synchronous_pipeline_compilation: true, ..default() });
    add(app, ImagePlugin::default_nearest());
    add(app, MeshPlugin);
    add(app, CameraPlugin);
    add(app, CorePipelinePlugin);
    // Sprites add systems for text, which need it.
    add(app, TextPlugin);
    add(app, SpritePlugin);
    add(app, SpriteRenderPlugin);
    add(app, TileLayerPlugin);
}

fn add<P: Plugin>(app: &mut App, plugin: P) {
    if !app.is_plugin_added::<P>() {
        app.add_plugins(plugin);
    }
}

/// Bevy's own systems, in schedules without systems of the game.
///
/// Most of them are private to Bevy. They are taken from an app that contains nothing else.
pub(super) struct SceneSchedule {
    /// Loading of assets, from `PreUpdate`.
    pub(super) load: Schedule,
    /// Transforms, bounds, visibility, asset events, from `PostUpdate`.
    pub(super) prepare: Schedule,
}

impl SceneSchedule {
    pub(super) fn new() -> Self {
        let mut app = App::new();
        // Bevy complains about plugins without a renderer. This one never runs.
        app.add_plugins(ExtractPlugin::default());
        add_renderer(&mut app, adapter::none());
        app.add_systems(PostUpdate, images::note_missing_images.after(AssetEventSystems));
        let mut schedules = app.world_mut().resource_mut::<Schedules>();
        let mut take = |label: bevy::ecs::schedule::InternedScheduleLabel| {
            let mut schedule = schedules.remove(label).unwrap_or_else(|| Schedule::new(label));
            schedule.set_executor(SingleThreadedExecutor::new());
            schedule
        };
        use bevy::ecs::schedule::ScheduleLabel;
        Self { load: take(PreUpdate.intern()), prepare: take(PostUpdate.intern()) }
    }
}

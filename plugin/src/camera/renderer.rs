//! Bevy's renderer, taken out of the app and run by hand.

use crate::{
    camera::{TileLayerPlugin, request},
    vision::VisionError,
};
use bevy::{
    app::{SubApp, TaskPoolPlugin},
    asset::{AssetEventSystems, AssetPlugin},
    camera::CameraPlugin,
    core_pipeline::CorePipelinePlugin,
    diagnostic::FrameCountPlugin,
    ecs::schedule::{Schedules, SingleThreadedExecutor},
    image::ImagePlugin,
    mesh::MeshPlugin,
    platform::cell::SyncCell,
    prelude::*,
    render::{
        RenderApp, RenderPlugin, RenderScheduleOrder,
        extract_plugin::ExtractPlugin,
        render_resource::PipelineCache,
        settings::{Backends, RenderCreation, WgpuSettings},
        view::ExtractedWindows,
    },
    sprite::SpritePlugin,
    sprite_render::SpriteRenderPlugin,
    tasks::block_on,
    text::TextPlugin,
    time::TimeReceiver,
    transform::TransformPlugin,
    window::{ExitCondition, WindowPlugin},
};

/// The renderer and the schedules that feed it.
#[derive(Resource, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
pub(super) struct Renderer {
    #[reflect(ignore)]
    app: SyncCell<SubApp>,
    #[reflect(ignore)]
    pub(super) scene: SceneSchedule,
    /// True if the app has windows to draw, besides the pictures of sensors.
    pub(super) shows_windows: bool,
}

impl Renderer {
    /// Takes the renderer out of the app, if it is there.
    pub(super) fn take(app: &mut App, shows_windows: bool) -> Option<Self> {
        let mut render_app = app.remove_sub_app(RenderApp)?;
        for (_, schedule) in render_app.world_mut().resource_mut::<Schedules>().iter_mut() {
            schedule.set_executor(SingleThreadedExecutor::new());
        }
        // The renderer would announce the time of each picture, and there may be several in a frame.
        app.world_mut().remove_resource::<TimeReceiver>();
        Some(Self { app: SyncCell::new(render_app), scene: SceneSchedule::new(), shows_windows })
    }

    pub(super) fn world(&mut self) -> &mut World {
        self.app.get().world_mut()
    }

    /// Draws the current World, with all active cameras.
    pub(super) fn draw(&mut self, world: &mut World) {
        let app = self.app.get();
        app.extract(world);
        run(app.world_mut());
    }

    /// Draws the current World, but no window.
    pub(super) fn draw_unseen(&mut self, world: &mut World) {
        let app = self.app.get();
        let shown = hide_windows(app.world_mut());
        app.extract(world);
        let open = hide_windows(app.world_mut());
        run(app.world_mut());
        let mut windows = app.world_mut().get_resource_or_init::<ExtractedWindows>();
        windows.primary = open.primary;
        windows.windows = shown.windows;
        windows.windows.retain(|window, _| open.windows.contains_key(window));
    }

    /// Returns whether all pipelines of the last picture were ready.
    pub(super) fn is_ready(&mut self) -> bool {
        self.world().resource::<PipelineCache>().waiting_pipelines().next().is_none()
    }
}

/// Takes the windows away, so that no picture is begun for them.
fn hide_windows(world: &mut World) -> ExtractedWindows {
    std::mem::take(&mut *world.get_resource_or_init::<ExtractedWindows>())
}

/// Draws the windows of an app, as Bevy would do after its schedules.
pub(super) fn draw_windows(world: &mut World) {
    let Some(mut renderer) = world.remove_resource::<Renderer>() else { return };
    renderer.draw(world);
    world.insert_resource(renderer);
}

fn run(world: &mut World) {
    world.resource_scope(|world, order: Mut<RenderScheduleOrder>| {
        for &label in &order.labels {
            // The order also names schedules that no plugin has filled.
            let _ = world.try_run_schedule(label);
        }
    });
    world.clear_trackers();
}

// Bevy's systems that prepare a scene for drawing.

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

/// Bevy's own systems after `Update` that prepare a scene for drawing, in schedules without systems of the game. So
/// they run in the middle of a tick.
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
        add_renderer(&mut app, none());
        app.add_systems(PostUpdate, request::note_missing_images.after(AssetEventSystems));
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

// Detection of a graphics adapter, and settings of the renderer.

/// Returns the settings of a renderer without a window. OpenGL is left out: it needs a display, and its drivers
/// print.
fn settings() -> WgpuSettings {
    WgpuSettings { backends: Some(Backends::from_env().unwrap_or(Backends::PRIMARY)), ..WgpuSettings::default() }
}

pub(crate) fn creation() -> RenderCreation {
    settings().into()
}

/// Settings of a renderer that draws nothing.
fn none() -> RenderCreation {
    WgpuSettings { backends: None, ..WgpuSettings::default() }.into()
}

/// Lets the C library keep the memory that drivers free after each picture, instead of returning it to the kernel.
///
/// Software Vulkan builds each picture in several megabytes of small blocks. glibc returns them after each picture,
/// and the page faults cost a third of the time. glibc does so from a size that is twice the largest separately
/// mapped block ever freed, up to 32 MiB.
pub(super) fn keep_memory() {
    const LARGE: usize = 31 << 20;
    drop(std::hint::black_box(Vec::<u8>::with_capacity(LARGE)));
}

/// Checks for an adapter, because Bevy panics without one.
pub(super) fn check() -> Result<(), VisionError> {
    let settings = settings();
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = settings.backends.unwrap_or(Backends::PRIMARY);
    descriptor.flags = settings.instance_flags;
    let instance = wgpu::Instance::new(descriptor);
    let options = wgpu::RequestAdapterOptions { power_preference: settings.power_preference, ..Default::default() };
    block_on(instance.request_adapter(&options)).map(drop).map_err(|_| VisionError::NoAdapter)
}

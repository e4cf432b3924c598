//! Bevy's renderer, taken out of the app and run by hand.

use bevy::{
    ecs::schedule::{Schedules, SingleThreadedExecutor},
    platform::cell::SyncCell,
    prelude::*,
    render::{RenderApp, RenderScheduleOrder, render_resource::PipelineCache, view::ExtractedWindows},
    time::TimeReceiver,
};

use super::scene_schedule::SceneSchedule;

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

//! The person's camera: the bots' square view, enlarged, with the player in the middle.

use crate::window::session::Deciders;
use bevy::{
    camera::{ScalingMode, Viewport},
    prelude::*,
    transform::helper::TransformHelper,
    window::PrimaryWindow,
};
use bevy_playbot::camera::TileBorder;

/// Factor of the view for each zoom key, and the most steps.
const ZOOM_STEP: f32 = 1.25;

const MOST_STEPS: i32 = 8;

pub(super) fn build(app: &mut App, width: f32) {
    // Tiles outside a level are drawn as far as the view reaches.
    app.insert_resource(TileBorder(Zoom { width, steps: MOST_STEPS }.side() / 2.0))
        .insert_resource(Zoom { width, steps: 0 })
        .insert_resource(ClearColor(Color::BLACK))
        .add_systems(Startup, spawn_camera)
        .add_systems(PostUpdate, (follow, zoom, keep_square).before(TransformSystems::Propagate));
}

/// Size of the view.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
pub(super) struct Zoom {
    /// World units of the bots' view from left to right.
    width: f32,
    /// Zoom steps out.
    steps: i32,
}

impl Zoom {
    /// Shows more.
    pub fn out(&mut self) {
        self.steps = (self.steps + 1).min(MOST_STEPS);
    }

    /// Shows less, down to the bots' view.
    pub fn closer(&mut self) {
        self.steps = (self.steps - 1).max(0);
    }

    /// Returns the size of the view relative to the nearest one.
    pub fn factor(&self) -> f32 {
        (0..self.steps).fold(1.0, |factor, _| factor * ZOOM_STEP)
    }

    /// Returns the world units from left to right.
    fn side(&self) -> f32 {
        self.width * self.factor()
    }

    fn scaling(&self) -> ScalingMode {
        let side = self.side();
        ScalingMode::AutoMin { min_width: side, min_height: side }
    }
}

/// Marks the person's camera.
#[derive(Component, Reflect)]
#[reflect(Component)]
struct WindowCamera;

fn spawn_camera(zoom: Res<Zoom>, mut commands: Commands) {
    let projection = OrthographicProjection { scaling_mode: zoom.scaling(), ..OrthographicProjection::default_2d() };
    commands.spawn((WindowCamera, Camera2d, Projection::Orthographic(projection), Msaa::Off));
}

fn follow(
    deciders: Res<Deciders>,
    mut camera: ParamSet<(TransformHelper, Single<&mut Transform, With<WindowCamera>>)>,
) {
    // Until the first level is drawn the agent may have no position.
    let Ok(at) = camera.p0().compute_global_transform(deciders.agent) else { return };
    let at = at.translation();
    let mut camera = camera.p1();
    camera.translation.x = at.x;
    camera.translation.y = at.y;
}

fn zoom(zoom: Res<Zoom>, mut camera: Single<&mut Projection, With<WindowCamera>>) {
    if zoom.is_changed()
        && let Projection::Orthographic(projection) = &mut **camera
    {
        projection.scaling_mode = zoom.scaling();
    }
}

/// Shows the square in the middle of a window of any shape.
fn keep_square(window: Single<Ref<Window>, With<PrimaryWindow>>, mut camera: Single<&mut Camera, With<WindowCamera>>) {
    let size = window.physical_size();
    let side = size.min_element();
    if side == 0
        || camera.viewport.as_ref().is_some_and(|viewport| viewport.physical_size == UVec2::splat(side))
            && !window.is_changed()
    {
        return;
    }
    camera.viewport =
        Some(Viewport { physical_position: (size - side) / 2, physical_size: UVec2::splat(side), ..default() });
}

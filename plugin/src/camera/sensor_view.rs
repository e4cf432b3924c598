//! Where agents look, in the main World.

use bevy::{
    camera::{ScalingMode, primitives::Aabb, visibility::ViewVisibility},
    core_pipeline::tonemapping::{DebandDither, Tonemapping},
    prelude::*,
    render::{camera::CameraRenderGraph, view::Msaa},
};

use super::sensor_view_draw::DrawSensorViews;

/// How far above and below the target things are seen, as with Bevy's own 2D camera.
const DEPTH: f32 = 1000.0;

/// Marks the one camera that all sensors share which follow a target.
///
/// A game that looks for its own camera with `Single<&Camera2d>` adds `Without<SensorCamera>`.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
pub struct SensorCamera;

/// A camera that sees everything and draws nothing by itself: what it would draw is dealt out to the sensors' views.
///
/// It neither tones nor dithers, so that colours are the bytes of the images they are from.
pub(super) fn spawn_camera(world: &mut World) -> Entity {
    let everything = OrthographicProjection {
        scaling_mode: ScalingMode::Fixed { width: 1e9, height: 1e9 },
        near: -DEPTH,
        far: DEPTH,
        ..OrthographicProjection::default_2d()
    };
    world
        .spawn((
            Name::new("camera of all sensors"),
            SensorCamera,
            Camera2d,
            Camera { order: isize::MIN, ..default() },
            Projection::Orthographic(everything),
            CameraRenderGraph::new(DrawSensorViews),
            Msaa::Off,
        ))
        .remove::<(Tonemapping, DebandDither)>()
        .id()
}

/// Which picture this is: numbers are never used twice, though a tick may be looked at twice.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub(super) struct Stamp {
    pub(super) look: u64,
    pub(super) tick: u64,
}

/// What one agent sees, and where it is drawn.
#[derive(Clone, Copy, Debug, Reflect)]
pub(super) struct SensorView {
    /// Pixels of the common texture.
    pub(super) cell: URect,
    /// The middle of the picture.
    pub(super) centre: Vec2,
    /// World units of the picture.
    pub(super) size: Vec2,
}

impl SensorView {
    pub(super) fn area(&self) -> Rect {
        Rect::from_center_size(self.centre, self.size)
    }

    /// From the view's coordinates to the picture's.
    pub(super) fn projection(&self) -> Mat4 {
        let half = self.size / 2.0;
        // Far and near are exchanged, as everywhere in Bevy.
        Mat4::orthographic_rh(-half.x, half.x, -half.y, half.y, DEPTH, -DEPTH)
    }
}

/// All views of this tick, and what there is to see.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct SensorViews {
    pub(super) camera: Option<Entity>,
    pub(super) views: Vec<SensorView>,
    /// What is visible, with the rectangle that it lies in.
    pub(super) bounds: Vec<(Entity, Rect)>,
}

/// Notes where everything is that may be drawn.
pub(super) fn note_bounds(
    mut views: ResMut<SensorViews>,
    drawn: Query<(Entity, &GlobalTransform, &Aabb, &ViewVisibility)>,
) {
    views.bounds.clear();
    for (entity, transform, aabb, visible) in &drawn {
        if visible.get() {
            views.bounds.push((entity, bounds(transform, aabb)));
        }
    }
}

fn bounds(transform: &GlobalTransform, aabb: &Aabb) -> Rect {
    let affine = transform.affine();
    let centre = affine.transform_point3a(aabb.center);
    let half = affine.matrix3.abs() * aabb.half_extents;
    Rect::from_center_half_size(centre.truncate(), half.truncate())
}

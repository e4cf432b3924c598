//! Views of agents, in the main World.

use bevy::{
    camera::{ScalingMode, primitives::Aabb, visibility::ViewVisibility},
    core_pipeline::tonemapping::{DebandDither, Tonemapping},
    prelude::*,
    render::{camera::CameraRenderGraph, view::Msaa},
};

use super::sensor_view_draw::DrawSensorViews;

/// Depth above and below the target that is visible, as with Bevy's own 2D camera.
const DEPTH: f32 = 1000.0;

/// Marks the camera that all sensors which follow a target share.
///
/// A game that finds its own camera with `Single<&Camera2d>` adds `Without<SensorCamera>`.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
pub struct SensorCamera;

/// Spawns a camera that sees everything and draws nothing by itself: its items are distributed to the sensors' views.
///
/// It neither tones nor dithers, so colours are the bytes of the images they are from.
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

/// Number of a picture. Numbers are never reused, though a tick may be drawn twice.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub(super) struct Stamp {
    pub(super) look: u64,
    pub(super) tick: u64,
}

/// The view of one agent, and the cell in which it is drawn.
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

    /// Returns the projection from the view's coordinates to the picture's.
    pub(super) fn projection(&self) -> Mat4 {
        let half = self.size / 2.0;
        // Far and near are exchanged, as everywhere in Bevy.
        Mat4::orthographic_rh(-half.x, half.x, -half.y, half.y, DEPTH, -DEPTH)
    }
}

/// All views of this tick, and the visible entities.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct SensorViews {
    pub(super) camera: Option<Entity>,
    pub(super) views: Vec<SensorView>,
    /// Visible entities, with their bounding rectangles.
    pub(super) bounds: Vec<(Entity, Rect)>,
}

/// Notes the position of everything that may be drawn.
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

//! Views of agents, in the main World.

use bevy::{
    camera::{ScalingMode, primitives::Aabb, visibility::ViewVisibility},
    core_pipeline::{
        core_2d::{AlphaMask2d, Opaque2d, Transparent2d},
        tonemapping::{DebandDither, Tonemapping},
    },
    ecs::{
        entity::EntityHashMap,
        schedule::{ScheduleLabel, SingleThreadedExecutor},
    },
    prelude::*,
    render::{
        Extract, ExtractSchedule, Render, RenderApp, RenderSystems,
        camera::CameraRenderGraph,
        render_phase::{SortedRenderPhase, ViewBinnedRenderPhases, ViewSortedRenderPhases},
        render_resource::{RenderPassDescriptor, StoreOp, TextureFormat},
        renderer::{RenderContext, ViewQuery},
        sync_world::MainEntity,
        view::{ExtractedView, Msaa, RetainedViewEntity, ViewDepthTexture, ViewTarget},
    },
    sprite_render::{Mesh2dViewBindGroup, SpriteViewBindGroup},
};
use std::sync::atomic::{AtomicU64, Ordering};

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

// Views of many sensors, drawn in the render World with the work of one camera.

/// Replaces Bevy's 2D rendering of the shared camera.
///
/// Bevy prepares the shared camera as any other: it extracts, specialises, queues and sorts everything once. Before
/// buffers are filled, the sorted items are distributed to one phase for each view that they intersect. All views are
/// then drawn in one pass, each with its own view uniform, viewport and scissor. Items that Bevy keeps in bins
/// (opaque 2D meshes) are few and are drawn for each view.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct DrawSensorViews;

/// The views in the render World. Their phases and entities are reused.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
struct RenderSensorViews {
    #[reflect(ignore)]
    scene: SensorViews,
    #[reflect(ignore)]
    entities: Vec<Entity>,
    /// Empty phases, kept between two pictures.
    #[reflect(ignore)]
    phases: Vec<SortedRenderPhase<Transparent2d>>,
    /// The shared camera's own phase, while the phases of the views replace it.
    #[reflect(ignore)]
    whole: Option<SortedRenderPhase<Transparent2d>>,
    #[reflect(ignore)]
    bounds: EntityHashMap<Rect>,
}

/// The stamp of the scene that was extracted last.
#[derive(Resource, Clone, Copy, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct ExtractedStamp(pub(super) Stamp);

/// The stamp of the scene that the views were drawn from last.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(super) struct DrawnStamp {
    look: AtomicU64,
    tick: AtomicU64,
}

impl DrawnStamp {
    fn set(&self, stamp: Stamp) {
        self.look.store(stamp.look, Ordering::Relaxed);
        self.tick.store(stamp.tick, Ordering::Relaxed);
    }

    pub(super) fn get(&self) -> Stamp {
        Stamp { look: self.look.load(Ordering::Relaxed), tick: self.tick.load(Ordering::Relaxed) }
    }
}

/// Adds the views of sensors to the renderer, if the app has one.
pub(super) fn add_sensor_views(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    let mut draw = Schedule::new(DrawSensorViews);
    draw.set_executor(SingleThreadedExecutor::new());
    draw.add_systems(draw_views);
    render_app
        .init_resource::<RenderSensorViews>()
        .init_resource::<ExtractedStamp>()
        .init_resource::<DrawnStamp>()
        .add_schedule(draw)
        .add_systems(ExtractSchedule, extract_views)
        .add_systems(
            Render,
            (
                make_views.after(RenderSystems::PhaseSort).before(RenderSystems::Prepare),
                lend_bind_groups.after(RenderSystems::PrepareBindGroups).before(RenderSystems::Render),
                restore_phases.in_set(RenderSystems::Cleanup),
            ),
        );
}

fn extract_views(
    mut views: ResMut<RenderSensorViews>,
    mut stamp: ResMut<ExtractedStamp>,
    main_views: Extract<Res<SensorViews>>,
    main_stamp: Extract<Res<Stamp>>,
) {
    stamp.0 = **main_stamp;
    let RenderSensorViews { scene, bounds, .. } = &mut *views;
    scene.camera = main_views.camera;
    scene.views.clone_from(&main_views.views);
    bounds.clear();
    bounds.extend(main_views.bounds.iter().copied());
}

/// Returns the view with this number.
fn retained_view(camera: Entity, number: usize) -> RetainedViewEntity {
    RetainedViewEntity::new(MainEntity::from(camera), None, number as u32 + 1)
}

/// Makes each view and distributes the items of the shared camera.
fn make_views(world: &mut World) {
    world.resource_scope(|world, mut views: Mut<RenderSensorViews>| {
        let Some(camera) = views.scene.camera else { return };
        while views.entities.len() < views.scene.views.len() {
            views.entities.push(world.spawn_empty().id());
        }
        while views.entities.len() > views.scene.views.len() {
            views.entities.pop().map(|entity| world.despawn(entity));
        }
        for (i, (&entity, view)) in views.entities.iter().zip(&views.scene.views).enumerate() {
            let size = view.cell.size();
            world.entity_mut(entity).insert(ExtractedView {
                retained_view_entity: retained_view(camera, i),
                clip_from_view: view.projection(),
                world_from_view: GlobalTransform::from_translation(view.centre.extend(0.0)),
                clip_from_world: None,
                target_format: TextureFormat::Rgba8UnormSrgb,
                viewport: UVec4::new(view.cell.min.x, view.cell.min.y, size.x, size.y),
                color_grading: default(),
                invert_culling: false,
            });
        }
        let mut phases = world.resource_mut::<ViewSortedRenderPhases<Transparent2d>>();
        let shared = RetainedViewEntity::new(MainEntity::from(camera), None, 0);
        let Some(whole) = phases.get_mut(&shared).map(std::mem::take) else { return };
        deal_out(&mut views, &whole, camera, &mut phases);
        views.whole = Some(whole);
        tone(world, camera, true);
    });
}

fn deal_out(
    views: &mut RenderSensorViews,
    whole: &SortedRenderPhase<Transparent2d>,
    camera: Entity,
    phases: &mut ViewSortedRenderPhases<Transparent2d>,
) {
    let areas: Vec<Rect> = views.scene.views.iter().map(|view| view.area()).collect();
    let mut seen: Vec<_> = areas.iter().map(|_| views.phases.pop().unwrap_or_default()).collect();
    for item in whole.items.values() {
        // An item without bounds may be anywhere.
        let bounds = views.bounds.get(&item.entity.1.id());
        for (area, phase) in areas.iter().zip(&mut seen) {
            if bounds.is_none_or(|bounds| touches(area, bounds)) {
                phase.add_transient(copy(item));
            }
        }
    }
    for (i, phase) in seen.into_iter().enumerate() {
        phases.insert(retained_view(camera, i), phase);
    }
}

fn touches(a: &Rect, b: &Rect) -> bool {
    a.min.x <= b.max.x && b.min.x <= a.max.x && a.min.y <= b.max.y && b.min.y <= a.max.y
}

fn copy(item: &Transparent2d) -> Transparent2d {
    Transparent2d {
        sort_key: item.sort_key,
        entity: item.entity,
        pipeline: item.pipeline,
        draw_function: item.draw_function,
        batch_range: item.batch_range.clone(),
        extracted_index: item.extracted_index,
        extra_index: item.extra_index.clone(),
        indexed: item.indexed,
    }
}

/// Switches the bind groups of tone mapping, which Bevy makes only for views that name one. The shared camera must
/// name none while pipelines are selected, so that nothing is toned.
fn tone(world: &mut World, camera: Entity, on: bool) {
    let mut views = world.query_filtered::<(Entity, &MainEntity), With<ExtractedView>>();
    let view = views.iter(world).find(|(_, main)| main.id() == camera).map(|(view, _)| view);
    match view {
        Some(view) if on => {
            world.entity_mut(view).insert(Tonemapping::None);
        }
        Some(view) => {
            world.entity_mut(view).remove::<Tonemapping>();
        }
        None => {}
    }
}

/// Shares the bind groups: all views use one buffer of uniforms, with one bind group each for sprites and meshes.
fn lend_bind_groups(
    views: Res<RenderSensorViews>,
    shared: Query<(&MainEntity, &SpriteViewBindGroup, &Mesh2dViewBindGroup)>,
    mut commands: Commands,
) {
    let Some((_, sprites, meshes)) = shared.iter().find(|(main, ..)| Some(main.id()) == views.scene.camera) else {
        return;
    };
    for &view in &views.entities {
        commands.entity(view).insert((
            SpriteViewBindGroup { value: sprites.value.clone() },
            Mesh2dViewBindGroup { value: meshes.value.clone() },
        ));
    }
}

/// Draws all views in one pass.
fn draw_views(
    world: &World,
    shared: ViewQuery<(&ExtractedView, &ViewTarget, &ViewDepthTexture)>,
    views: Res<RenderSensorViews>,
    drawn: Res<DrawnStamp>,
    stamp: Res<ExtractedStamp>,
    background: Res<ClearColor>,
    transparent: Res<ViewSortedRenderPhases<Transparent2d>>,
    opaque: Res<ViewBinnedRenderPhases<Opaque2d>>,
    masked: Res<ViewBinnedRenderPhases<AlphaMask2d>>,
    mut context: RenderContext,
) {
    let (shared_view, target, depth) = shared.into_inner();
    let Some(camera) = views.scene.camera else { return };
    let Some(attachment) = target.out_texture_color_attachment(Some(background.to_linear())) else { return };
    let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("sensor views"),
        color_attachments: &[Some(attachment)],
        depth_stencil_attachment: Some(depth.get_attachment(StoreOp::Discard)),
        ..default()
    });
    let opaque = opaque.get(&shared_view.retained_view_entity).filter(|phase| !phase.is_empty());
    let masked = masked.get(&shared_view.retained_view_entity).filter(|phase| !phase.is_empty());
    for (i, (&entity, view)) in views.entities.iter().zip(&views.scene.views).enumerate() {
        let (corner, size) = (view.cell.min, view.cell.size());
        let rect = [corner.x as f32, corner.y as f32, size.x as f32, size.y as f32];
        pass.set_viewport(rect[0], rect[1], rect[2], rect[3], 0.0, 1.0);
        pass.set_scissor_rect(corner.x, corner.y, size.x, size.y);
        let result = opaque
            .map_or(Ok(()), |phase| phase.render(&mut pass, world, entity))
            .and_then(|()| masked.map_or(Ok(()), |phase| phase.render(&mut pass, world, entity)))
            .and_then(|()| {
                transparent
                    .get(&retained_view(camera, i))
                    .map_or(Ok(()), |phase| phase.render(&mut pass, world, entity))
            });
        if let Err(error) = result {
            // The stamp stays behind, so the picture counts as missing.
            return tracing::error!("the picture of a sensor could not be drawn: {error:?}");
        }
    }
    drawn.set(stamp.0);
}

/// Restores the phases to Bevy's state.
fn restore_phases(world: &mut World) {
    world.resource_scope(|world, mut views: Mut<RenderSensorViews>| {
        let Some(camera) = views.scene.camera else { return };
        let mut phases = world.resource_mut::<ViewSortedRenderPhases<Transparent2d>>();
        for i in 0..views.entities.len() {
            if let Some(mut phase) = phases.remove(&retained_view(camera, i)) {
                phase.items.clear();
                phase.transient_items.clear();
                views.phases.push(phase);
            }
        }
        if let Some(whole) = views.whole.take() {
            phases.insert(RetainedViewEntity::new(MainEntity::from(camera), None, 0), whole);
        }
        tone(world, camera, false);
    });
}

//! Sun, floor and walls.

use bevy::{
    image::{ImageAddressMode, ImageSampler, ImageSamplerDescriptor},
    light::CascadeShadowConfigBuilder,
    math::Affine2,
    prelude::*,
};

use crate::ant::view::{Ground, flat::floor_tile};

/// Side of the floor of an arena without walls, and extent of a floor behind walls, metres.
const OPEN: f32 = 400.0;
const MARGIN: f32 = 20.0;

const WALLS: Color = Color::srgb(0.42, 0.45, 0.55);

/// Shared materials.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
pub struct Paints {
    wall: Handle<StandardMaterial>,
    floor: Handle<Image>,
}

/// Entities of a ground.
#[derive(Component, Reflect)]
#[reflect(Component)]
pub struct Built(Vec<Entity>);

/// Adds one light, whose shadows are sharp around the camera.
pub fn sun(mut commands: Commands) {
    let shadows = CascadeShadowConfigBuilder {
        num_cascades: 2,
        first_cascade_far_bound: 14.0,
        maximum_distance: 60.0,
        ..default()
    };
    commands.spawn((
        DirectionalLight { illuminance: 7000.0, shadow_maps_enabled: true, ..default() },
        shadows.build(),
        Transform::from_xyz(-4.0, -6.0, 12.0).looking_at(Vec3::ZERO, Vec3::Z),
    ));
}

/// Prepares the materials.
pub fn paints(
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut images: ResMut<Assets<Image>>,
    mut commands: Commands,
) {
    let (u, v) = (ImageAddressMode::Repeat, ImageAddressMode::Repeat);
    let repeated = ImageSamplerDescriptor { address_mode_u: u, address_mode_v: v, ..ImageSamplerDescriptor::linear() };
    let floor = Image { sampler: ImageSampler::Descriptor(repeated), ..floor_tile() };
    commands.insert_resource(Paints { wall: materials.add(matt(WALLS)), floor: images.add(floor) });
}

/// Returns a material that does not shine.
pub fn matt(colour: Color) -> StandardMaterial {
    StandardMaterial { base_color: colour, perceptual_roughness: 0.9, reflectance: 0.1, ..default() }
}

/// Builds floors and walls of new grounds.
pub fn grounds(
    changed: Query<(Entity, &Ground, Option<&Built>), Changed<Ground>>,
    paints: Res<Paints>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut commands: Commands,
) {
    for (arena, ground, built) in &changed {
        built.into_iter().flat_map(|built| &built.0).for_each(|&entity| commands.entity(entity).despawn());
        let (middle, size) = extent(ground);
        let repeat = Affine2::from_scale(size / ground.cell);
        let paint = StandardMaterial {
            base_color_texture: Some(paints.floor.clone()),
            uv_transform: repeat,
            ..matt(Color::WHITE)
        };
        let floor = (Mesh3d(meshes.add(Rectangle::from_size(size))), MeshMaterial3d(materials.add(paint)));
        let mut parts =
            vec![commands.spawn((ChildOf(arena), floor, Transform::from_translation(middle.extend(0.0)))).id()];
        for wall in &ground.boxes {
            let mesh = Mesh3d(meshes.add(Cuboid { half_size: wall.half.into() }));
            let place = Transform::from_translation(wall.centre.into());
            parts.push(commands.spawn((ChildOf(arena), mesh, MeshMaterial3d(paints.wall.clone()), place)).id());
        }
        commands.entity(arena).insert(Built(parts));
    }
}

/// Returns the middle and size of a floor: whole cells, so its squares match the cells.
fn extent(ground: &Ground) -> (Vec2, Vec2) {
    if ground.columns == 0 {
        return (Vec2::ZERO, Vec2::splat(OPEN));
    }
    let rows = ground.is_wall.len() as u32 / ground.columns;
    let size = Vec2::new(ground.columns as f32, rows as f32) * ground.cell;
    (Vec2::from(ground.corner) + size / 2.0, size + 2.0 * MARGIN)
}

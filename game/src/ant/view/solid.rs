//! View in space, with meshes, a sun and shadows, for people in a window.

use crate::ant::{
    body::{PARTS, Part},
    view::{AntPose, AntViewSystems, ArenaGround, GoalMark, OnGround, flat, flat::floor_tile},
};
use bevy::{
    image::{ImageAddressMode, ImageSampler, ImageSamplerDescriptor},
    light::CascadeShadowConfigBuilder,
    math::Affine2,
    prelude::*,
};
use bevy_playbot::vision::VisionSystems;
use playbot_harness::{inspect::CameraFocus, prelude::*};

/// Adds meshes to all entities that [`AntViewPlugin`](crate::ant::view::AntViewPlugin) draws. x, y and z are those of
/// the physics: z is up. The camera is the window's.
#[derive(Clone, Copy, Debug, Default)]
pub struct SolidViewPlugin;

impl Plugin for SolidViewPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(GlobalAmbientLight { brightness: 400.0, ..default() })
            .add_systems(Startup, (sun, paints).chain())
            .add_systems(
                ObserveSchedule,
                (grounds, build, goals, note_poses).chain().after(AntViewSystems::Draw).in_set(VisionSystems::Sync),
            )
            .add_systems(Update, glide);
    }
}

// Ants of spheres and capsules, which glide from tick to tick.

/// Height of the light over a goal, metres.
const BEAM: f32 = 3.0;

/// The meshes of an agent's ant.
#[derive(Component, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
pub struct SolidAnt {
    limbs: [Entity; PARTS],
    goal: Entity,
    /// Pose before and after the last tick.
    #[reflect(ignore)]
    from: [Part; PARTS],
    #[reflect(ignore)]
    to: [Part; PARTS],
}

/// Makes meshes of new ants.
pub(crate) fn build(
    new: Query<(Entity, &OnGround, &AntPose), Without<SolidAnt>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut commands: Commands,
) {
    for (agent, ground, pose) in &new {
        let mut number = 0;
        let limbs = pose.0.map(|limb| {
            let mesh = meshes.add(mesh(&limb));
            let paint = materials.add(matt(flat::colour(number)));
            number += 1;
            commands.spawn((ChildOf(ground.0), Mesh3d(mesh), MeshMaterial3d(paint), place(&limb))).id()
        });
        let goal = commands.spawn((ChildOf(ground.0), Transform::default(), Visibility::default())).id();
        // The camera follows the torso.
        commands.entity(agent).insert((CameraFocus(limbs[0]), SolidAnt { limbs, goal, from: pose.0, to: pose.0 }));
    }
}

fn mesh(limb: &Part) -> Mesh {
    if limb.half_length == 0.0 {
        Sphere::new(limb.radius).into()
    } else {
        Capsule3d::new(limb.radius, 2.0 * limb.half_length).into()
    }
}

fn place(limb: &Part) -> Transform {
    Transform::from_translation(limb.centre).with_rotation(limb.rotation)
}

/// Marks new goals: a disc with a light above it, visible over walls.
pub(crate) fn goals(
    changed: Query<(&GoalMark, &SolidAnt), Or<(Changed<GoalMark>, Added<SolidAnt>)>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut commands: Commands,
) {
    for (goal, ant) in &changed {
        let disc = (
            Mesh3d(meshes.add(Cylinder::new(goal.radius, 0.02))),
            MeshMaterial3d(materials.add(matt(flat::GOAL_COLOUR))),
        );
        let light = StandardMaterial {
            base_color: flat::GOAL_COLOUR.with_alpha(0.25),
            alpha_mode: AlphaMode::Blend,
            unlit: true,
            ..default()
        };
        let beam = (Mesh3d(meshes.add(Cylinder::new(goal.radius / 4.0, BEAM))), MeshMaterial3d(materials.add(light)));
        let [x, y] = goal.at;
        // Cylinders stand along y.
        let upright = Transform::from_xyz(x, y, 0.01).with_rotation(Quat::from_rotation_arc(Vec3::Y, Vec3::Z));
        commands.entity(ant.goal).despawn_related::<Children>().insert((upright, Visibility::default())).with_children(
            |marks| {
                marks.spawn((disc, Transform::default()));
                marks.spawn((beam, Transform::from_xyz(0.0, BEAM / 2.0, 0.0), bevy::light::NotShadowCaster));
            },
        );
    }
}

/// Takes over new poses. It runs before and after every tick, so an ant glides from one to the other, but jumps when it
/// was moved in between.
pub(crate) fn note_poses(mut ants: Query<(&AntPose, &mut SolidAnt)>) {
    for (pose, mut ant) in &mut ants {
        ant.from = ant.to;
        ant.to = pose.0;
    }
}

/// Moves the meshes: frames are drawn more often than ticks are played.
pub(crate) fn glide(clock: Res<Time<Fixed>>, ants: Query<&SolidAnt>, mut limbs: Query<&mut Transform>) {
    let share = clock.overstep_fraction();
    for ant in &ants {
        for (&entity, (from, to)) in ant.limbs.iter().zip(ant.from.iter().zip(&ant.to)) {
            let Ok(mut transform) = limbs.get_mut(entity) else { continue };
            transform.translation = from.centre.lerp(to.centre, share);
            transform.rotation = from.rotation.slerp(to.rotation, share);
        }
    }
}

// Sun, floor and walls.

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
pub(crate) fn sun(mut commands: Commands) {
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
pub(crate) fn paints(
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
pub(crate) fn matt(colour: Color) -> StandardMaterial {
    StandardMaterial { base_color: colour, perceptual_roughness: 0.9, reflectance: 0.1, ..default() }
}

/// Builds floors and walls of new grounds.
pub(crate) fn grounds(
    changed: Query<(Entity, &ArenaGround, Option<&Built>), Changed<ArenaGround>>,
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
fn extent(ground: &ArenaGround) -> (Vec2, Vec2) {
    if ground.columns == 0 {
        return (Vec2::ZERO, Vec2::splat(OPEN));
    }
    let rows = ground.is_wall.len() as u32 / ground.columns;
    let size = Vec2::new(ground.columns as f32, rows as f32) * ground.cell;
    (Vec2::from(ground.corner) + size / 2.0, size + 2.0 * MARGIN)
}

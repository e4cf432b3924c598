//! Ants of spheres and capsules, which glide from tick to tick.

use bevy::prelude::*;

use playbot_lab::space_view::CameraFocus;

use super::scenery::matt;
use crate::ant::{
    parts::{PARTS, Part},
    view::{AntPose, GoalMark, OnGround, flat},
};

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
pub fn build(
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
pub fn goals(
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
pub fn note_poses(mut ants: Query<(&AntPose, &mut SolidAnt)>) {
    for (pose, mut ant) in &mut ants {
        ant.from = ant.to;
        ant.to = pose.0;
    }
}

/// Moves the meshes: frames are drawn more often than ticks are played.
pub fn glide(clock: Res<Time<Fixed>>, ants: Query<&SolidAnt>, mut limbs: Query<&mut Transform>) {
    let share = clock.overstep_fraction();
    for ant in &ants {
        for (&entity, (from, to)) in ant.limbs.iter().zip(ant.from.iter().zip(&ant.to)) {
            let Ok(mut transform) = limbs.get_mut(entity) else { continue };
            transform.translation = from.centre.lerp(to.centre, share);
            transform.rotation = from.rotation.slerp(to.rotation, share);
        }
    }
}

//! Ants from above: a disc for the torso, a bar for each limb, and a disc for the goal.

use bevy::prelude::*;

use super::{
    art::Art,
    layers::{GOAL, LIMBS},
};
use crate::ant::{
    parts::Part,
    view::{AntPose, GoalMark, OnGround},
};

/// Torso, seen from above and, of an ant that lies on its back, from below.
const TORSO: Color = Color::srgb(0.66, 0.26, 0.20);
const BELLY: Color = Color::srgb(0.95, 0.80, 0.55);
/// Legs: the first is lighter than the others, so that the ant's heading shows.
const FIRST_LEG: Color = Color::srgb(0.93, 0.55, 0.22);
const LEG: Color = Color::srgb(0.45, 0.20, 0.17);
pub const GOAL_COLOUR: Color = Color::srgb(0.20, 0.62, 0.32);
/// Each leg has three limbs.
const LIMBS_OF_A_LEG: usize = 3;
/// Factor by which a part grows per metre of height.
const NEARER: f32 = 0.1;

/// The sprites of an ant: limbs in the order of its parts, without the torso, which is the agent itself; then the goal.
#[derive(Component, Reflect)]
#[reflect(Component)]
pub struct Sprites {
    limbs: Vec<Entity>,
    goal: Entity,
}

/// Returns the colour of a limb, by its number among the parts of an ant.
pub fn colour(number: usize) -> Color {
    match number {
        0 => TORSO,
        1..=LIMBS_OF_A_LEG => FIRST_LEG,
        _ => LEG,
    }
}

/// Makes sprites of new ants.
pub fn spawn(new: Query<(Entity, &OnGround, &AntPose), Without<Sprites>>, art: Res<Art>, mut commands: Commands) {
    for (agent, ground, pose) in &new {
        let limb = |number| {
            let sprite = Sprite::from_color(colour(number), Vec2::ZERO);
            commands.spawn((ChildOf(ground.0), sprite, Transform::default())).id()
        };
        let limbs = (1..pose.0.len()).map(limb).collect();
        let disc = |diameter, color| Sprite {
            color,
            custom_size: Some(Vec2::splat(diameter)),
            ..Sprite::from_image(art.disc.clone())
        };
        let hidden = (disc(0.0, GOAL_COLOUR), Visibility::Hidden, Transform::default());
        let goal = commands.spawn((ChildOf(ground.0), hidden)).id();
        let torso = disc(2.0 * pose.0[0].radius, TORSO);
        commands.entity(agent).insert((ChildOf(ground.0), torso, Transform::default(), Sprites { limbs, goal }));
    }
}

/// Moves torso and limbs to their poses.
pub fn pose(
    mut ants: Query<(&AntPose, &Sprites, &mut Transform, &mut Sprite)>,
    mut limbs: Query<(&mut Transform, &mut Sprite), Without<Sprites>>,
) {
    for (pose, sprites, mut transform, mut sprite) in &mut ants {
        let [torso, legs @ ..] = &pose.0;
        transform.translation = place(torso);
        let upright = (torso.rotation * Vec3::Z).z > 0.0;
        sprite.color = if upright { TORSO } else { BELLY };
        for (limb, &entity) in legs.iter().zip(&sprites.limbs) {
            let Ok((mut transform, mut sprite)) = limbs.get_mut(entity) else { continue };
            let along = (limb.rotation * Vec3::Y * limb.half_length).truncate();
            transform.translation = place(limb);
            transform.rotation = Quat::from_rotation_arc_2d(Vec2::X, along.try_normalize().unwrap_or(Vec2::X));
            sprite.custom_size = Some(2.0 * Vec2::new(along.length() + limb.radius, limb.radius));
        }
    }
}

fn place(part: &Part) -> Vec3 {
    part.centre.truncate().extend(LIMBS + NEARER * (part.centre.z + part.radius))
}

/// Moves the discs to the goals.
pub fn goals(
    changed: Query<(&GoalMark, &Sprites), Or<(Changed<GoalMark>, Added<Sprites>)>>,
    mut discs: Query<(&mut Transform, &mut Sprite, &mut Visibility)>,
) {
    for (goal, sprites) in &changed {
        let Ok((mut transform, mut sprite, mut visibility)) = discs.get_mut(sprites.goal) else { continue };
        let [x, y] = goal.at;
        transform.translation = Vec3::new(x, y, GOAL);
        sprite.custom_size = Some(Vec2::splat(2.0 * goal.radius));
        *visibility = Visibility::Inherited;
    }
}

//! Floor and walls as rapier colliders.
//!
//! rapier finds the walls near the ant, and answers the rays and shape casts of a game's own sensors. It does not move the
//! ant: its impulse joints do not keep up with hinges whose rotors are a hundred times heavier than the limbs, see
//! [the module](super).

use bevy::math::{DVec3, Vec3};
use bevy_rapier3d::rapier::prelude::*;

use super::contact::WallBox;

/// No part of the ant is further from the torso's centre than this in one control step, in metres: legs of 1.13 m and
/// the way of a jump.
const REACH: f32 = 2.5;

/// The floor and the walls of an arena.
pub struct Walls {
    boxes: Vec<WallBox>,
    world: PhysicsWorld,
}

impl Walls {
    /// A floor at height 0 and these walls.
    pub fn new(boxes: &[WallBox]) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::new(0.0, 0.0, -9.81);
        let floor = ColliderBuilder::new(SharedShape::halfspace(Vector::Z)).user_data(boxes.len() as u128);
        world.insert_collider(floor, None);
        for (index, wall) in boxes.iter().enumerate() {
            let [x, y, z] = wall.half;
            let collider = ColliderBuilder::cuboid(x, y, z).translation(Vector::from_array(wall.centre));
            world.insert_collider(collider.user_data(index as u128), None);
        }
        // The broad phase knows only what it has seen in a step.
        world.step();
        Self { boxes: boxes.to_vec(), world }
    }

    /// rapier's view of the arena, to cast rays in. A collider's user data is its number in [`boxes`](Self::boxes); the
    /// floor has the next.
    pub fn physics(&self) -> &PhysicsWorld {
        &self.world
    }

    /// All walls.
    pub fn boxes(&self) -> &[WallBox] {
        &self.boxes
    }

    /// The walls that an ant can touch within one control step, in the order of their numbers.
    pub(super) fn near(&self, position: DVec3, near: &mut Vec<WallBox>) {
        near.clear();
        if self.boxes.is_empty() || !position.is_finite() {
            return;
        }
        let centre: Vec3 = position.as_vec3();
        let around = Aabb::new(centre - Vec3::splat(REACH), centre + Vec3::splat(REACH));
        let mut numbers: Vec<usize> = self
            .world
            .query_pipeline()
            .intersect_aabb_conservative(around)
            .map(|(_, collider)| collider.user_data as usize)
            .filter(|&number| number < self.boxes.len())
            .collect();
        numbers.sort_unstable();
        near.extend(numbers.into_iter().map(|number| self.boxes[number]));
    }
}

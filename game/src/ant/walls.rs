//! Floor and walls as rapier colliders.
//!
//! rapier finds the walls near the ant, and answers the rays and shape casts of a game's own sensors. It does not move
//! the ant. Its impulse joints do not keep up with hinges whose rotors are a hundred times heavier than the limbs, see
//! [the module](super).

use crate::ant::contact::WallBox;
use bevy::math::{DVec3, Vec3};
use bevy_rapier3d::rapier::prelude::*;

/// Largest distance of a part of the ant from the torso's centre in one control step, in metres. It covers legs of 1.13
/// m and the path of a jump.
const REACH: f32 = 2.5;

/// The floor and the walls of an arena.
pub struct Walls {
    boxes: Vec<WallBox>,
    world: PhysicsWorld,
}

impl Walls {
    /// Returns a floor at height 0 and these walls.
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
        // The broad phase has only the colliders of earlier steps.
        world.step();
        Self { boxes: boxes.to_vec(), world }
    }

    /// Returns rapier's view of the arena, to cast rays in. A collider's user data is its number in
    /// [`boxes`](Self::boxes); the floor has the next.
    pub fn physics(&self) -> &PhysicsWorld {
        &self.world
    }

    /// Returns all walls.
    pub fn boxes(&self) -> &[WallBox] {
        &self.boxes
    }

    /// Writes the walls that an ant can touch within one control step to `near`, in the order of their numbers.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ant::{AntBody, AntState};

    fn block(x: f32, y: f32) -> WallBox {
        WallBox { centre: [x, y, 1.0], half: [2.0, 2.0, 1.0] }
    }

    #[test]
    fn the_walls_nearby_are_those_within_reach() {
        let boxes: Vec<_> = (0..100).map(|i| block(8.0 * (i % 10) as f32, 8.0 * (i / 10) as f32)).collect();
        let walls = Walls::new(&boxes);
        let mut near = Vec::new();
        for [x, y] in [[4.0, 0.0], [36.0, 36.0], [12.2, 20.0], [-50.0, 3.0]] {
            walls.near(DVec3::new(x, y, 0.5), &mut near);
            let touches = |wall: &&WallBox| {
                (wall.centre[0] - x as f32).abs() <= 2.0 + 1.3 && (wall.centre[1] - y as f32).abs() <= 2.0 + 1.3
            };
            for wall in boxes.iter().filter(touches) {
                assert!(near.contains(wall), "{wall:?} from ({x}, {y})");
            }
            assert!(near.len() <= 4, "{} from ({x}, {y})", near.len());
        }
    }

    #[test]
    fn a_thrown_ant_does_not_pass_a_wall() {
        for angle in [0.0, 0.3, 0.8, 1.2] {
            let mut ant = AntBody::new(&[block(4.0, 0.0)]);
            let mut state = AntState::nominal();
            state.qpos[1] = 1.0;
            (state.qpos[3], state.qpos[6]) = (f64::cos(angle) as f32, f64::sin(angle) as f32);
            (state.qvel[0], state.qvel[5]) = (12.0, 4.0);
            ant.set_state(&state);
            for _ in 0..30 {
                ant.step(&[0.0; 8]);
                // Contacts are soft: at 12 m/s a limb sinks in by a quarter of a metre, out of the wall's four.
                let deepest = ant.parts().iter().map(|part| part.centre.x + part.radius).fold(f32::MIN, f32::max);
                let beside = ant.torso().0.y.abs() > 3.4;
                assert!(beside || deepest < 2.5, "{deepest} at angle {angle}");
            }
            assert!(ant.torso().0.x < 2.0, "bounced off at angle {angle}");
        }
    }

    #[test]
    fn rays_meet_floor_and_walls() {
        let walls = Walls::new(&[block(4.0, 0.0)]);
        let hit = |from: Vec3, direction: Vec3| {
            let (collider, distance) =
                walls.physics().cast_ray(&Ray::new(from, direction), 100.0, true, QueryFilter::default())?;
            Some((walls.physics().colliders[collider].user_data, distance))
        };
        assert_eq!(hit(Vec3::new(0.0, 0.0, 1.0), Vec3::X), Some((0, 2.0)));
        assert_eq!(hit(Vec3::new(0.0, 0.0, 1.0), Vec3::NEG_Z), Some((1, 1.0)));
        assert_eq!(hit(Vec3::new(0.0, 0.0, 1.0), Vec3::NEG_X), None);
    }
}

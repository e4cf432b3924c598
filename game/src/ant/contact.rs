//! Contacts of the ant with the floor and walls, and the walls around it.
//!
//! The ant is balls and capsules against a plane and upright boxes. As in MuJoCo a capsule touches with the balls at its
//! two ends, and a wall's edge also with the nearest point between.
//!
//! Floor and walls are rapier colliders, too. rapier finds the walls near the ant, and answers the rays and shape casts of
//! a game's own sensors. It does not move the ant. Its impulse joints do not keep up with hinges whose rotors are a hundred
//! times heavier than the limbs, see [`ant`](crate::ant).

use crate::ant::{
    kinematics::Pose,
    skeleton::{LEGS, LIMB_RADIUS, TORSO_RADIUS},
};
use bevy::math::{DVec3, Vec3};
use bevy_rapier3d::rapier::prelude::*;

/// Contacts begin this far before surfaces touch, in metres.
pub const MARGIN: f64 = 0.01;

/// A fixed upright box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallBox {
    /// Centre, in metres.
    pub centre: [f32; 3],
    /// Half of its size along each axis, in metres.
    pub half: [f32; 3],
}

/// The part of the ant in a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limb {
    /// The ball in the middle.
    Torso,
    /// The limb of a leg that is fixed to the torso.
    Fixed,
    /// The limb between hip and ankle.
    Upper,
    /// The limb below the ankle.
    Lower,
}

/// A point at which two surfaces are less than [`MARGIN`] apart.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// The part that touches.
    pub limb: Limb,
    /// Its leg; 0 for the torso.
    pub leg: usize,
    /// Midway between the surfaces, in the world.
    pub point: DVec3,
    /// Direction in which the ant is pushed, in the world.
    pub normal: DVec3,
    /// Direction in which friction is measured first, in the world; it need not be level with the surface.
    pub along: DVec3,
    /// Distance of the surfaces, negative where they overlap, in metres.
    pub distance: f64,
}

/// Finds the contacts of a pose.
pub fn find(pose: &Pose, walls: &[WallBox], contacts: &mut Vec<Contact>) {
    contacts.clear();
    let mut finder = Finder { walls, contacts };
    finder.ball(Limb::Torso, 0, pose.position, TORSO_RADIUS);
    for leg in 0..LEGS {
        let at = &pose.legs[leg];
        let [hip, ankle, foot] = [at.hip, at.ankle, at.foot].map(|point| pose.to_world(point));
        finder.capsule(Limb::Fixed, leg, pose.position, hip);
        finder.capsule(Limb::Upper, leg, hip, ankle);
        finder.capsule(Limb::Lower, leg, ankle, foot);
    }
}

struct Finder<'a> {
    walls: &'a [WallBox],
    contacts: &'a mut Vec<Contact>,
}

impl Finder<'_> {
    fn ball(&mut self, limb: Limb, leg: usize, centre: DVec3, radius: f64) {
        self.on_floor(limb, leg, centre, radius, DVec3::Y);
        for wall in self.walls {
            self.at_wall(limb, leg, centre, radius, wall);
        }
    }

    fn capsule(&mut self, limb: Limb, leg: usize, from: DVec3, to: DVec3) {
        self.on_floor(limb, leg, from, LIMB_RADIUS, to - from);
        self.on_floor(limb, leg, to, LIMB_RADIUS, to - from);
        for wall in self.walls {
            if let Some(between) = nearest_between(from, to, wall) {
                self.at_wall(limb, leg, from.lerp(to, between), LIMB_RADIUS, wall);
            }
            self.at_wall(limb, leg, from, LIMB_RADIUS, wall);
            self.at_wall(limb, leg, to, LIMB_RADIUS, wall);
        }
    }

    fn on_floor(&mut self, limb: Limb, leg: usize, centre: DVec3, radius: f64, along: DVec3) {
        let distance = centre.z - radius;
        if distance < MARGIN {
            let point = centre - DVec3::Z * (radius + distance / 2.0);
            self.contacts.push(Contact { limb, leg, point, normal: DVec3::Z, along, distance });
        }
    }

    fn at_wall(&mut self, limb: Limb, leg: usize, centre: DVec3, radius: f64, wall: &WallBox) {
        let (normal, from_centre) = towards(centre, wall);
        let distance = from_centre - radius;
        if distance < MARGIN {
            let point = centre - normal * (radius + distance / 2.0);
            let along = if normal.y.abs() < 0.5 { DVec3::Y } else { DVec3::Z };
            self.contacts.push(Contact { limb, leg, point, normal, along, distance });
        }
    }
}

/// Returns the direction out of a box to a point and their distance, which is negative inside.
fn towards(point: DVec3, wall: &WallBox) -> (DVec3, f64) {
    let (centre, half): (DVec3, DVec3) = (wall.centre.map(f64::from).into(), wall.half.map(f64::from).into());
    let offset: DVec3 = point - centre;
    let outside = offset - offset.clamp(-half, half);
    let distance = outside.length();
    if distance > 1e-9 {
        return (outside / distance, distance);
    }
    // Inside, the direction is out through the nearest side, but never up or down.
    let depth = half - offset.abs();
    if depth.x < depth.y { (DVec3::X * offset.x.signum(), -depth.x) } else { (DVec3::Y * offset.y.signum(), -depth.y) }
}

/// Returns the point between the ends of a segment that is nearest to a box, if there is one: 0 is `from`, 1 is `to`.
fn nearest_between(from: DVec3, to: DVec3, wall: &WallBox) -> Option<f64> {
    let (centre, half): (DVec3, DVec3) = (wall.centre.map(f64::from).into(), wall.half.map(f64::from).into());
    let reach = DVec3::splat(LIMB_RADIUS + MARGIN) + half;
    let (a, b) = (from - centre, to - centre);
    if a.min(b).cmpgt(reach).any() || a.max(b).cmplt(-reach).any() {
        return None;
    }
    // The squared distance is convex along the segment: its slope is bisected.
    let along = b - a;
    let slope = |t: f64| {
        let at = a + along * t;
        (at - at.clamp(-half, half)).dot(along)
    };
    let (mut low, mut high) = (0.0, 1.0);
    if slope(low) >= 0.0 || slope(high) <= 0.0 {
        return None;
    }
    for _ in 0..20 {
        let middle = (low + high) / 2.0;
        if slope(middle) < 0.0 { low = middle } else { high = middle }
    }
    Some((low + high) / 2.0)
}

// The floor and walls as rapier colliders.

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

//! Contacts of the ant with the floor and walls: balls and capsules against a plane and upright boxes.
//!
//! As in MuJoCo a capsule touches with the balls at its two ends, and a wall's edge also with the nearest point
//! between.

use crate::ant::{
    kinematics::Pose,
    skeleton::{LEGS, LIMB_RADIUS, TORSO_RADIUS},
};
use bevy::math::DVec3;

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

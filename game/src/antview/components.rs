//! What there is to be seen.

use bevy::prelude::*;

use crate::ant::{Part, PartShape, WallBox};

/// The limbs of an agent's ant, in the coordinates of its arena: torso first.
#[derive(Component, Clone, Debug)]
pub struct AntPose(pub [Limb; 13]);

impl AntPose {
    /// The pose with these limbs, as [`AntBody::parts`](crate::ant::AntBody::parts) has them.
    pub fn of(parts: &[Part; 13]) -> Self {
        Self(parts.each_ref().map(Limb::of))
    }
}

/// A sphere, or a capsule along its own y axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limb {
    /// The middle, metres.
    pub centre: Vec3,
    /// How it is turned.
    pub rotation: Quat,
    /// Its radius, metres.
    pub radius: f32,
    /// From the middle to the centre of either end, metres; 0 for a sphere.
    pub half_length: f32,
}

impl Limb {
    /// From the middle to the centre of one end.
    pub fn half_axis(&self) -> Vec3 {
        self.rotation * Vec3::Y * self.half_length
    }
}

/// Where an agent's ant should go.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub struct GoalMark {
    /// `[x, y]` in metres.
    pub at: [f32; 2],
    /// How near it must come, metres.
    pub radius: f32,
}

/// The arena in which an agent's ant walks: an entity with a [`Ground`].
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
pub struct OnGround(pub Entity);

/// Floor and walls of an arena, in square cells.
#[derive(Component, Clone, Debug)]
pub struct Ground {
    /// Side of a cell, metres.
    pub cell: f32,
    /// The corner of the first cell, `[x, y]` in metres: cells go from there along x, and rows of them along y.
    pub corner: [f32; 2],
    /// Cells in a row; none for an open floor.
    pub columns: u32,
    /// Which cells are walls, row by row.
    pub is_wall: Vec<bool>,
    /// Whether everything outside the cells is wall, instead of floor.
    pub walled: bool,
    /// The walls.
    pub boxes: Vec<WallBox>,
}

impl Ground {
    /// A floor without walls.
    pub fn open() -> Self {
        Self { cell: 4.0, corner: [0.0; 2], columns: 0, is_wall: Vec::new(), walled: false, boxes: Vec::new() }
    }
}

impl Limb {
    fn of(part: &Part) -> Self {
        let (radius, half_length) = match part.shape {
            PartShape::Sphere { radius } => (radius, 0.0),
            PartShape::Capsule { radius, half_length } => (radius, half_length),
        };
        let (centre, rotation) = (Vec3::from_array(part.translation), Quat::from_array(part.rotation));
        Self { centre, rotation, radius, half_length }
    }
}

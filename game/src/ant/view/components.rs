//! What there is to be seen.

use bevy::prelude::*;

use crate::ant::{
    contact::WallBox,
    parts::{PARTS, Part},
};

/// The torso and the limbs of an agent's ant, in the coordinates of its arena, as
/// [`AntBody::parts`](crate::ant::AntBody::parts) has them.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct AntPose(pub [Part; PARTS]);

/// Where an agent's ant should go.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component)]
pub struct GoalMark {
    /// `[x, y]` in metres.
    pub at: [f32; 2],
    /// How near it must come, metres.
    pub radius: f32,
}

/// The arena in which an agent's ant walks: an entity with a [`Ground`].
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component)]
pub struct OnGround(pub Entity);

/// Floor and walls of an arena, in square cells.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
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

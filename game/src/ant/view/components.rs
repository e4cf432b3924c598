//! Components that are drawn.

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

/// The goal of an agent's ant.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component)]
pub struct GoalMark {
    /// `[x, y]` in metres.
    pub at: [f32; 2],
    /// Distance at which it counts as reached, metres.
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
    /// Cells in a row; 0 for an open floor.
    pub columns: u32,
    /// Marks walls among the cells, row by row.
    pub is_wall: Vec<bool>,
    /// Everything outside the cells is wall, instead of floor.
    pub walled: bool,
    /// The walls.
    pub boxes: Vec<WallBox>,
}

impl Ground {
    /// Returns a floor without walls.
    pub fn open() -> Self {
        Self { cell: 4.0, corner: [0.0; 2], columns: 0, is_wall: Vec::new(), walled: false, boxes: Vec::new() }
    }
}

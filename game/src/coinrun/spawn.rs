//! Inhabitants of a level, and their starts.

use super::rules::Body;

/// A body that a level starts with. Cells are tile coordinates; the body's centre is the middle of
/// its cell.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Spawn {
    /// A saw. It never moves.
    Saw([i32; 2]),
    /// A patrolling enemy.
    Enemy {
        /// Start cell.
        cell: [i32; 2],
        /// Start direction: 1 right, -1 left.
        dir: i8,
        /// Picture, 0 to 8.
        sprite: u8,
    },
    /// A crate. It never moves.
    Crate {
        /// Cell.
        cell: [i32; 2],
        /// Picture, 0 to 3.
        sprite: u8,
    },
}

impl Spawn {
    pub(super) fn saw(&self) -> Option<Body> {
        match *self {
            Spawn::Saw(cell) => Some(Body::block(cell)),
            _ => None,
        }
    }

    pub(super) fn enemy(&self) -> Option<Body> {
        match *self {
            Spawn::Enemy { cell, dir, .. } => Some(Body::enemy(cell, dir)),
            _ => None,
        }
    }

    pub(super) fn solid_crate(&self) -> Option<Body> {
        match *self {
            Spawn::Crate { cell, .. } => Some(Body::block(cell)),
            _ => None,
        }
    }
}

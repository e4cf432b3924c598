//! State of a player in the search, apart from its position along x.

use super::bins::Bins;

/// A state of the search.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum State {
    /// Height and speed are known.
    Exact(Exact),
    /// They are known within limits.
    Loose(Loose),
}

/// Exact height and speed.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Exact {
    /// Height of the centre, tiles.
    pub y: f32,
    /// Vertical speed, tiles per step.
    pub vy: f32,
    /// True if something other than a wall gives support.
    pub is_held: bool,
}

impl Exact {
    /// Returns the key that tells it from others.
    pub fn key(&self) -> (u32, u32, bool) {
        (self.y.to_bits(), self.vy.to_bits(), self.is_held)
    }
}

/// A height and an upper limit of the speed upwards, in tenths of a tile.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(super) struct Loose {
    /// Tenth of a tile of the centre.
    pub level: i32,
    /// Its largest rise in the last step.
    pub lift: i32,
}

/// Adds positions to the known ones of an equal key.
pub(super) fn put<T: PartialEq>(all: &mut Vec<(T, Bins)>, thing: T, places: Bins) {
    if places.is_empty() {
        return;
    }
    match all.iter_mut().find(|(known, _)| *known == thing) {
        Some((_, known)) => *known |= places,
        None => all.push((thing, places)),
    }
}

//! What the search knows of a player apart from the place along x.

use super::bins::Bins;

/// A state of the search.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum State {
    /// Height and speed are known.
    Exact(Exact),
    /// They are known within limits.
    Loose(Loose),
}

/// Height and speed as the rules have them.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Exact {
    /// Height of the centre, tiles.
    pub y: f32,
    /// Vertical speed, tiles per step.
    pub vy: f32,
    /// Whether something other than a wall gives support.
    pub is_held: bool,
}

impl Exact {
    /// What tells it from others.
    pub fn key(&self) -> (u32, u32, bool) {
        (self.y.to_bits(), self.vy.to_bits(), self.is_held)
    }
}

/// A height and an upper limit of the speed upwards, in tenths of a tile.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(super) struct Loose {
    /// Which tenth of a tile the centre is in.
    pub level: i32,
    /// The most that it rises in the last step.
    pub lift: i32,
}

/// Adds places to those that are known of the same thing.
pub(super) fn put<T: PartialEq>(all: &mut Vec<(T, Bins)>, thing: T, places: Bins) {
    if places.is_empty() {
        return;
    }
    match all.iter_mut().find(|(known, _)| *known == thing) {
        Some((_, known)) => *known |= places,
        None => all.push((thing, places)),
    }
}

//! The crates that paths can meet.

use super::swept::Swept;
use crate::coinrun::rules::{Body, OVERLAP_MARGIN};

/// A crate, with the quantities that decide whether it holds the player.
#[derive(Clone, Copy, Debug)]
struct Holder {
    x: f32,
    y: f32,
    reach: [f32; 2],
    /// Height from which the player's centre has to come.
    top: f32,
}

/// Crates near a player.
#[derive(Debug, Default)]
pub(super) struct NearCrates {
    bodies: Vec<Body>,
    holders: Vec<Holder>,
}

impl NearCrates {
    /// Replaces the crates, for this player.
    pub fn replace<'a>(&mut self, player: &Body, crates: impl Iterator<Item = &'a Body>) {
        self.bodies.clear();
        self.holders.clear();
        for block in crates {
            self.bodies.push(*block);
            self.holders.push(Holder {
                x: block.x,
                y: block.y,
                reach: [(player.rx + block.rx) + OVERLAP_MARGIN, (player.ry + block.ry) + OVERLAP_MARGIN],
                top: block.y + block.ry + player.ry,
            });
        }
    }

    /// Returns true if one may hold a player who falls from height `from` through these places.
    #[inline]
    pub fn may_hold(&self, from: f32, swept: &Swept) -> bool {
        self.holders.iter().any(|block| from >= block.top && swept.comes_near([block.x; 2], block.y, block.reach))
    }

    /// Returns the crates in creation order; empty if no crate can hold a player who falls from height `from`.
    #[inline]
    pub fn below(&self, from: f32) -> &[Body] {
        if self.holders.iter().any(|block| from >= block.top) { &self.bodies } else { &[] }
    }
}

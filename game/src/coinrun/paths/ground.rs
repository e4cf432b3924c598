//! Tiles and crates around a player, and the buttons of paths.

use crate::coinrun::{
    paths::sweep::Swept,
    rules::{Body, CORNER, OVERLAP_MARGIN},
    tile::{Corners, TileGrid},
};

/// Tiles and crates around a player of a certain size.
pub(super) struct PathGround<'a> {
    pub tiles: &'a TileGrid,
    pub crates: &'a NearCrates,
    /// Half width and half height of the player.
    pub rx: f32,
    pub ry: f32,
    /// Distance from its centre to the corners that are tested against tiles.
    pub corner_x: f32,
    pub corner_y: f32,
}

impl<'a> PathGround<'a> {
    pub fn new(tiles: &'a TileGrid, crates: &'a NearCrates, player: &Body) -> Self {
        let Body { rx, ry, .. } = *player;
        Self { tiles, crates, rx, ry, corner_x: rx * CORNER, corner_y: ry * CORNER }
    }

    /// Returns the corners that are tested against tiles, for all these centres.
    #[inline]
    pub fn corners(&self, swept: &Swept) -> Corners {
        Corners {
            left: swept.x[0] - self.corner_x,
            right: swept.x[1] + self.corner_x,
            low: swept.y[0] - self.corner_y,
            high: swept.y[1] + self.corner_y,
        }
    }
}

// The buttons of paths, and the values of each path.

/// Buttons that are tried: right and jump, right, jump, nothing, left, left and jump.
pub const HELD: [u8; 6] = [8, 7, 5, 4, 1, 2];

/// A path is followed for at most this many steps: a jump on flat ground takes 16.
pub const STEPS: u32 = 20;

/// Values per path.
pub const VALUES: usize = 6;

/// Names of the values of one path.
pub const NAMES: [&str; VALUES] = ["dies", "coin", "lands", "steps", "dx", "dy"];

// The crates that paths can meet.

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::tile::Tile;

    #[test]
    fn rectangles_see_what_is_between_their_corners() {
        let mut grid = TileGrid::default();
        grid.set(5, 9, Tile::WallTop);
        grid.set(5, 20, Tile::Coin);
        grid.set(6, 30, Tile::LavaTop);
        let box_from = |x: f32, y: f32, high: f32| Corners { left: x, right: x + 2.5, low: y, high };
        assert!(grid.is_clear(&box_from(3.0, 7.0, 8.5)) && !grid.is_clear(&box_from(3.0, 7.0, 9.0)));
        assert!(!grid.is_clear(&box_from(4.0, 1.0, 18.0)) && grid.is_clear(&box_from(6.0, 1.0, 18.0)));
        assert!(!grid.is_clear(&box_from(62.0, 1.0, 2.0)), "outside is wall");
        assert!(grid.has_no_ends(&box_from(4.0, 8.0, 10.0)));
        assert!(!grid.has_no_ends(&box_from(4.0, 19.0, 21.0)) && !grid.has_no_ends(&box_from(4.0, 29.0, 31.0)));
        grid.set(5, 20, Tile::Empty);
        assert!(grid.has_no_ends(&box_from(4.0, 19.0, 21.0)));
    }
}

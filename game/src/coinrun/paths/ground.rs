//! Ground and obstacles around a player.

use super::{near_crates::NearCrates, swept::Swept};
use crate::coinrun::{
    rules::{Body, CORNER},
    tile::{Corners, TileGrid},
};

/// Tiles and crates around a player of a certain size.
pub(super) struct Ground<'a> {
    pub tiles: &'a TileGrid,
    pub crates: &'a NearCrates,
    /// Half width and half height of the player.
    pub rx: f32,
    pub ry: f32,
    /// Distance from its centre to the corners that are tested against tiles.
    pub corner_x: f32,
    pub corner_y: f32,
}

impl<'a> Ground<'a> {
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

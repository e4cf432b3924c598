//! Tiles and crates around a player, the buttons of paths, and a step that nothing blocks.

use crate::coinrun::{
    paths::Walker,
    rules::{Body, CORNER, OVERLAP_MARGIN, part_count},
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

// The step that nothing blocks, and the centres that are passed on the way.

/// From this square of the speed on, a step has five parts, and from these on six and seven.
///
/// The smallest numbers whose square root, times four, is rounded to no less than 5, 6 and 7.
const FIVE: f32 = f32::from_bits(0x3fc7_ffff);

const SIX: f32 = 2.25;

const SEVEN: f32 = 3.0625;

/// The parts of a step, and its end if nothing blocks it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep {
    /// Number of equal parts.
    pub parts: u32,
    /// Displacement of one part.
    pub by: [f32; 2],
    /// End of all parts: each is added for itself, and rounded.
    pub end: [f32; 2],
}

impl Sweep {
    /// Returns the step of a player with this velocity.
    #[inline(always)]
    pub fn new(walker: &Walker) -> Self {
        let Walker { mut x, mut y, vx, vy, .. } = *walker;
        let square = vx * vx + vy * vy;
        if square < FIVE {
            let by = [vx * 0.25, vy * 0.25];
            for _ in 0..4 {
                x += by[0];
                y += by[1];
            }
            return Self { parts: 4, by, end: [x, y] };
        }
        let parts = if square < SIX {
            5
        } else if square < SEVEN {
            6
        } else {
            part_count(vx, vy)
        };
        let share = 1.0 / parts as f32;
        let by = [vx * share, vy * share];
        for _ in 0..parts {
            x += by[0];
            y += by[1];
        }
        Self { parts, by, end: [x, y] }
    }
}

/// The centres that a player passes in a step, or in a path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Swept {
    /// Smallest and largest x.
    pub x: [f32; 2],
    /// Smallest and largest y.
    pub y: [f32; 2],
}

impl Swept {
    /// Returns the range between two positions.
    #[inline]
    pub fn between(a: [f32; 2], b: [f32; 2]) -> Self {
        let sorted = |a: f32, b: f32| if a < b { [a, b] } else { [b, a] };
        Self { x: sorted(a[0], b[0]), y: sorted(a[1], b[1]) }
    }

    /// Adds a position.
    #[inline]
    pub fn add(&mut self, [x, y]: [f32; 2]) {
        let wider = |range: &mut [f32; 2], at: f32| {
            range[0] = if at < range[0] { at } else { range[0] };
            range[1] = if at > range[1] { at } else { range[1] };
        };
        wider(&mut self.x, x);
        wider(&mut self.y, y);
    }

    /// Returns true if one of the positions may be nearer than `reach` to one between `from` and `to` (along x).
    ///
    /// A rounded difference grows with its first number and falls with the second. So this misses no position for which
    /// [`Body::overlaps`](crate::coinrun::rules::Body::overlaps) is true.
    #[inline]
    pub fn comes_near(&self, [from, to]: [f32; 2], y: f32, reach: [f32; 2]) -> bool {
        self.x[0] - to < reach[0] && from - self.x[1] < reach[0] && self.y[0] - y < reach[1] && y - self.y[1] < reach[1]
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

    #[test]
    fn the_thresholds_are_those_of_the_square_root() {
        for (parts, threshold) in [(5, FIVE), (6, SIX), (7, SEVEN)] {
            let count = |square: f32| ((4.0 * square.sqrt()) as u32).max(4);
            assert_eq!((count(threshold), count(threshold.next_down())), (parts, parts - 1));
        }
    }

    #[test]
    fn what_is_passed_on_the_way_comes_near() {
        let swept = Swept::between([3.0, 2.0], [1.0, 5.0]);
        assert!(swept.comes_near([2.0; 2], 3.5, [0.1; 2]));
        assert!(swept.comes_near([0.5, 0.75], 5.5, [0.5, 0.75]));
        assert!(!swept.comes_near([0.5; 2], 3.5, [0.5; 2]), "only as near as the reach");
        assert!(!swept.comes_near([2.0; 2], 6.0, [1.0; 2]));
        assert!(!swept.comes_near([3.5, 4.0], 3.5, [0.5; 2]));
    }

    #[test]
    fn added_places_widen_it() {
        let mut swept = Swept::between([1.0, 1.0], [1.0, 1.0]);
        swept.add([0.0, 3.0]);
        swept.add([2.0, 2.0]);
        assert_eq!((swept.x, swept.y), ([0.0, 2.0], [1.0, 3.0]));
    }
}

//! A step that nothing blocks.

use crate::coinrun::{paths::Walker, rules::part_count};

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

//! A step that nothing blocks.

use super::walker::Walker;
use crate::coinrun::rules::part_count;

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
}

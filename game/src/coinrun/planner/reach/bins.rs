//! Sets of positions along x.

use crate::coinrun::tile::SIZE;
use std::ops::{BitAnd, BitOr, BitOrAssign, Not};

/// Number of bins over the width of a level. A bin is a little wider than an eighth of a tile, the longest displacement
/// of one part of a step. Four bins are a little wider than that of a whole step: rounding never leads further.
pub(crate) const BINS: usize = 508;

/// Width of a bin, tiles.
pub(crate) const WIDTH: f32 = SIZE as f32 / BINS as f32;

/// Bins that full speed crosses in a step.
pub(crate) const STEP_BINS: usize = 4;

const WORDS: usize = BINS.div_ceil(64);

/// A set of bins.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Bins([u64; WORDS]);

impl Bins {
    /// No bin.
    pub const NONE: Self = Self([0; WORDS]);

    /// Returns the bins for which a condition holds.
    pub fn of(mut holds: impl FnMut(usize) -> bool) -> Self {
        let mut bins = Self::NONE;
        for bin in (0..BINS).filter(|&bin| holds(bin)) {
            bins.0[bin / 64] |= 1 << (bin % 64);
        }
        bins
    }

    /// Returns the bin of a position.
    pub fn at(x: f32) -> Self {
        let place = ((x / WIDTH) as usize).min(BINS - 1);
        Self::of(|bin| bin == place)
    }

    /// Returns the ends of a bin, tiles from the left.
    pub fn ends(bin: usize) -> [f32; 2] {
        [bin as f32 * WIDTH, (bin + 1) as f32 * WIDTH]
    }

    /// Returns true if no bin is in it.
    pub fn is_empty(&self) -> bool {
        *self == Self::NONE
    }

    /// Returns the distance from the nearest bin to that of a position, in bins; an empty set is far away.
    pub fn distance(&self, x: f32) -> usize {
        let is_in = |bin: usize| self.0[bin / 64] >> (bin % 64) & 1 == 1;
        let there = ((x / WIDTH) as usize).min(BINS - 1);
        let near = (0..BINS).find(|&far| {
            let left = there.checked_sub(far).is_some_and(is_in);
            left || there + far < BINS && is_in(there + far)
        });
        near.unwrap_or(BINS)
    }

    /// Returns these bins and those at most so many bins away.
    #[must_use]
    pub fn spread(mut self, by: usize) -> Self {
        for _ in 0..by {
            self = self.spread_by_one();
        }
        self
    }

    fn spread_by_one(self) -> Self {
        let words = self.0;
        let mut spread = words;
        for word in 0..WORDS {
            let from_left = if word > 0 { words[word - 1] >> 63 } else { 0 };
            let from_right = words.get(word + 1).map_or(0, |next| next << 63);
            spread[word] |= words[word] << 1 | from_left | words[word] >> 1 | from_right;
        }
        // Nothing lies behind the last bin.
        spread[WORDS - 1] &= u64::MAX >> (WORDS * 64 - BINS);
        Self(spread)
    }
}

impl BitAnd for Bins {
    type Output = Self;

    fn bitand(mut self, other: Self) -> Self {
        self.0.iter_mut().zip(other.0).for_each(|(word, other)| *word &= other);
        self
    }
}

impl BitOr for Bins {
    type Output = Self;

    fn bitor(mut self, other: Self) -> Self {
        self |= other;
        self
    }
}

impl BitOrAssign for Bins {
    fn bitor_assign(&mut self, other: Self) {
        self.0.iter_mut().zip(other.0).for_each(|(word, other)| *word |= other);
    }
}

impl Not for Bins {
    type Output = Self;

    fn not(mut self) -> Self {
        self.0.iter_mut().for_each(|word| *word = !*word);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::rules::WALK_SPEED;

    #[test]
    fn bins_spread_to_both_sides_and_not_beyond_the_level() {
        let bins = Bins::of(|bin| [0, 63, 300, 507].contains(&bin)).spread(2);
        let expected =
            Bins::of(|bin| [0, 1, 2, 61, 62, 63, 64, 65, 505, 506, 507].contains(&bin) || bin.abs_diff(300) <= 2);
        assert_eq!(bins, expected);
        assert_eq!(Bins::at(64.0), Bins::of(|bin| bin == BINS - 1));
        let bins = Bins::of(|bin| [10, 40].contains(&bin));
        let distance = |bin: usize| bins.distance((bin as f32 + 0.5) * WIDTH);
        assert_eq!([3, 10, 22, 30, 507].map(distance), [7, 0, 12, 10, 467]);
        assert_eq!(Bins::NONE.distance(3.0), BINS);
    }

    #[test]
    fn full_speed_stays_within_the_bins_of_a_step() {
        // Rounding adds at most a few millionths of a tile.
        assert!(WALK_SPEED + 1e-4 < STEP_BINS as f32 * WIDTH && WALK_SPEED / 4.0 + 1e-5 < WIDTH);
    }
}

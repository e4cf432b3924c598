//! Procgen's choice of the next level.

use bevy_playbot::level::LevelSource;
use rand_mt::Mt;

/// One past the largest seed of the unlimited level set (0 to 2^31 - 2).
const UNLIMITED: u32 = i32::MAX as u32;

/// The set of level seeds that episodes are drawn from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LevelSet {
    /// First seed of the set. Not used when `num_levels` is 0.
    pub start_level: u32,
    /// Number of consecutive seeds; 0 means every seed below 2^31 - 1.
    pub num_levels: u32,
}

impl LevelSet {
    fn first(self) -> u32 {
        if self.num_levels == 0 { 0 } else { self.start_level }
    }

    fn len(self) -> u32 {
        if self.num_levels == 0 { UNLIMITED } else { self.num_levels }
    }
}

/// An endless sequence of level seeds for one environment, drawn with replacement.
///
/// An agent chooses its levels by it under `bevy_playbot::level::LevelQueue::Custom(Box::new(levels))`.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ProcgenLevels {
    levels: LevelSet,
    generator: Mt,
}

impl ProcgenLevels {
    /// Returns a sequence whose own generator starts from `seed`.
    pub fn new(levels: LevelSet, seed: u32) -> Self {
        Self { levels, generator: Mt::new(seed) }
    }

    /// Returns the seed of the next level.
    pub fn next_level(&mut self) -> u32 {
        let offset = self.generator.next_u32() % self.levels.len();
        self.levels.first().wrapping_add(offset)
    }
}

impl LevelSource for ProcgenLevels {
    fn next_level(&mut self) -> Option<u64> {
        Some(Self::next_level(self).into())
    }

    fn clone_box(&self) -> Box<dyn LevelSource> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stays_in_the_set_and_covers_it() {
        let mut levels = ProcgenLevels::new(LevelSet { start_level: 64, num_levels: 64 }, 5);
        let mut seen = [false; 64];
        for _ in 0..2000 {
            seen[(levels.next_level() - 64) as usize] = true;
        }
        assert!(seen.iter().all(|&seen| seen));
    }

    #[test]
    fn zero_levels_means_all() {
        let mut levels = ProcgenLevels::new(LevelSet { start_level: 3, num_levels: 0 }, 0);
        let seeds: Vec<u32> = (0..1000).map(|_| levels.next_level()).collect();
        assert!(seeds.iter().all(|&seed| seed < UNLIMITED));
        assert!(seeds.iter().any(|&seed| seed > UNLIMITED / 2));
    }
}

//! Which level comes next: Procgen's level picking.

use rand_mt::Mt;
use serde::{Deserialize, Serialize};

/// One past the largest seed of the unlimited level set (0 to 2^31 - 2).
const UNLIMITED: u32 = i32::MAX as u32;

/// The set of level seeds that episodes are drawn from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
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
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LevelQueue {
    levels: LevelSet,
    seed: u32,
    draws: u64,
    generator: Mt,
}

/// What is needed to continue a [`LevelQueue`]: it is restored by repeating its draws.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct LevelQueueState {
    /// The set of levels.
    pub levels: LevelSet,
    /// Seed of the queue's own generator.
    pub seed: u32,
    /// Number of levels drawn so far.
    pub draws: u64,
}

impl LevelQueue {
    /// A queue whose own generator starts from `seed`.
    pub fn new(levels: LevelSet, seed: u32) -> Self {
        Self { levels, seed, draws: 0, generator: Mt::new(seed) }
    }

    /// The queues of `count` environments, seeded from the successive outputs of one generator
    /// that starts from `rand_seed`.
    pub fn for_envs(levels: LevelSet, rand_seed: u32, count: usize) -> Vec<Self> {
        let mut seeds = Mt::new(rand_seed);
        (0..count).map(|_| Self::new(levels, seeds.next_u32())).collect()
    }

    /// The seed of the next level.
    pub fn next_level(&mut self) -> u32 {
        self.draws += 1;
        let offset = self.generator.next_u32() % self.levels.len();
        self.levels.first().wrapping_add(offset)
    }

    /// The state for a checkpoint.
    pub fn state(&self) -> LevelQueueState {
        LevelQueueState { levels: self.levels, seed: self.seed, draws: self.draws }
    }

    /// Continues where the queue with this state left off.
    pub fn restore(state: LevelQueueState) -> Self {
        let mut queue = Self::new(state.levels, state.seed);
        for _ in 0..state.draws {
            queue.generator.next_u32();
        }
        queue.draws = state.draws;
        queue
    }
}

/// Lets an agent choose its levels as the original does:
/// `bevy_playbot::level::LevelQueue::Custom(Box::new(queue))`.
impl bevy_playbot::level::LevelSource for LevelQueue {
    fn next_level(&mut self) -> Option<u64> {
        Some(Self::next_level(self).into())
    }

    fn clone_box(&self) -> Box<dyn bevy_playbot::level::LevelSource> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCORE: LevelSet = LevelSet { start_level: 64, num_levels: 64 };

    #[test]
    fn stays_in_the_set_and_covers_it() {
        let mut queue = LevelQueue::new(SCORE, 5);
        let mut seen = [false; 64];
        for _ in 0..2000 {
            seen[(queue.next_level() - 64) as usize] = true;
        }
        assert!(seen.iter().all(|&seen| seen));
    }

    #[test]
    fn zero_levels_means_all() {
        let all = LevelSet { start_level: 3, num_levels: 0 };
        let mut queue = LevelQueue::new(all, 0);
        let seeds: Vec<u32> = (0..1000).map(|_| queue.next_level()).collect();
        assert!(seeds.iter().all(|&seed| seed < UNLIMITED));
        assert!(seeds.iter().any(|&seed| seed > UNLIMITED / 2));
    }

    #[test]
    fn environments_differ_and_restore() {
        let mut queues = LevelQueue::for_envs(SCORE, 1, 2);
        assert_ne!(queues[0].state().seed, queues[1].state().seed);
        let queue = &mut queues[1];
        for _ in 0..700 {
            queue.next_level();
        }
        let mut restored = LevelQueue::restore(queue.state());
        assert_eq!(restored, *queue);
        assert_eq!(restored.next_level(), queue.next_level());
    }
}

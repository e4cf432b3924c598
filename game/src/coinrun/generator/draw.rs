//! The random numbers of the generator, in the order in which they are drawn.

use rand_mt::Mt;

/// The random decisions of the generator.
pub(super) struct Draw(Mt);

impl Draw {
    /// Returns the decisions of the level with this seed.
    pub(super) fn new(seed: u32) -> Self {
        Self(Mt::new(seed))
    }

    /// Returns a uniform number in `0..high` (with the small modulo bias of the original). One output.
    pub(super) fn below(&mut self, high: i32) -> i32 {
        (self.0.next_u32() % high as u32) as i32
    }

    /// Returns a uniform number in `[0, 1]`, rounded to f32. One output.
    pub(super) fn unit(&mut self) -> f32 {
        (f64::from(self.0.next_u32()) / (f64::from(u32::MAX) + 1.0)) as f32
    }

    /// Returns the draws of the first 1024 steps, one output each: bit `k` is set when step `k` (from 0) resolves a tie
    /// between the axes in favour of x.
    pub(super) fn tie_breaks(&mut self) -> [u64; 16] {
        let mut bits = [0; 16];
        for step in 0..1024 {
            let even = self.0.next_u32().is_multiple_of(2);
            bits[step / 64] |= u64::from(even) << (step % 64);
        }
        bits
    }
}

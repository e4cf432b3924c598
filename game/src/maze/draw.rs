//! The random decisions of the generator.

use rand_mt::Mt64;

/// Random numbers that are the same on every machine.
pub(super) struct Draw(Mt64);

impl Draw {
    pub(super) fn new(seed: u64) -> Self {
        Self(Mt64::new(seed))
    }

    /// Returns a uniform number in `0..high`, with a modulo bias that no maze is large enough to show. `high` is at
    /// least 1.
    pub(super) fn below(&mut self, high: usize) -> usize {
        (self.0.next_u64() % high as u64) as usize
    }

    /// Returns one of them; `None` if there is none.
    pub(super) fn pick<T: Copy>(&mut self, from: &[T]) -> Option<T> {
        (!from.is_empty()).then(|| from[self.below(from.len())])
    }

    /// Moves a random choice of `count` items, in random order, to the front.
    pub(super) fn shuffle_front<T>(&mut self, items: &mut [T], count: usize) {
        for at in 0..count.min(items.len()) {
            let from = at + self.below(items.len() - at);
            items.swap(at, from);
        }
    }
}

//! Memory that one pass hands to the next: new pages from the system cost as much as the sums that fill them.

use crate::among_workers::are_awake;
use rayon::prelude::*;
use std::{
    ops::{Deref, DerefMut},
    sync::{Mutex, PoisonError},
};

/// Largest number of waiting pieces.
const MOST: usize = 128;

/// Size below which memory is not worth keeping.
const LEAST: usize = 1 << 10;

static WAITING: Mutex<Vec<Vec<f32>>> = Mutex::new(Vec::new());

/// Numbers with unspecified initial values. Their memory is reused after they are dropped.
#[derive(Debug)]
pub struct KeptMemory(Vec<f32>);

impl KeptMemory {
    /// Takes memory for this many numbers.
    pub(crate) fn take(len: usize) -> Self {
        let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
        // The smallest sufficient piece; a much larger one waits for other uses.
        let fits = |numbers: &Vec<f32>| (len.max(LEAST)..=2 * len).contains(&numbers.capacity());
        let places = (0..waiting.len()).filter(|place| fits(&waiting[*place]));
        let place = places.min_by_key(|place| waiting[*place].capacity());
        let found = place.map(|place| waiting.remove(place));
        drop(waiting);
        let mut numbers = found.unwrap_or_else(|| vec![0.0; len]);
        numbers.resize(len, 0.0);
        Self(numbers)
    }

    /// Takes memory for this many zeros.
    pub(crate) fn zeros(len: usize) -> Self {
        let mut memory = Self::take(len);
        memory.fill(0.0);
        memory
    }

    /// Returns the numbers, for a tensor. [`Self::leave`] brings the memory back.
    pub(crate) fn into_vec(mut self) -> Vec<f32> {
        std::mem::take(&mut self.0)
    }

    /// Gives memory back for reuse.
    pub fn leave(numbers: Vec<f32>) {
        drop(Self(numbers));
    }
}

impl Drop for KeptMemory {
    fn drop(&mut self) {
        if self.0.capacity() < LEAST {
            return;
        }
        let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.push(std::mem::take(&mut self.0));
        // The piece that has waited longest: its size is no longer in use.
        let unwanted = (waiting.len() > MOST).then(|| waiting.remove(0));
        drop(waiting);
        drop(unwanted);
    }
}

impl Deref for KeptMemory {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.0
    }
}

impl DerefMut for KeptMemory {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.0
    }
}

// Distribution of work among threads.

/// Number of products below which a second thread costs more than it saves: waking one takes as long as a million of
/// them.
const FEW: usize = 1 << 22;

/// The same limit where other threads are awake.
const FEW_AWAKE: usize = 1 << 18;

/// Number of products that take as long as moving a number.
pub const OF_A_MOVE: usize = 8;

/// Calls `work` with each piece of `len` items and its number, on all threads if there are many products in all.
pub fn share<T: Send>(items: &mut [T], len: usize, products: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    if products < if are_awake() { FEW_AWAKE } else { FEW } {
        items.chunks_mut(len).enumerate().for_each(|(piece, items)| work(piece, items));
    } else {
        items.par_chunks_mut(len).enumerate().for_each(|(piece, items)| work(piece, items));
    }
}

/// Does [`share`] for items that are pieces already.
pub fn share_each<T: Send>(items: &mut [T], products: usize, work: impl Fn(usize, &mut T) + Sync) {
    share(items, 1, products, |piece, items| items.iter_mut().for_each(|item| work(piece, item)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_has_the_length_that_is_asked_for_whatever_waits() {
        for len in [7, 3, 2900, 0, 8, 2901, 1500, 2901] {
            let mut memory = KeptMemory::take(len);
            assert_eq!(memory.len(), len);
            memory.fill(1.0);
        }
        let several: Vec<KeptMemory> = (0..2 * MOST).map(|_| KeptMemory::take(LEAST)).collect();
        drop(several);
        assert!(WAITING.lock().expect("sound").len() <= MOST);
    }
}

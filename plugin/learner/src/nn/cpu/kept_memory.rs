//! Memory that one pass hands to the next: new pages from the system cost as much as the sums that fill them.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// Largest number of waiting pieces.
const MOST: usize = 128;
/// Size below which memory is not worth keeping.
const LEAST: usize = 1 << 10;

static WAITING: Mutex<Vec<Vec<f32>>> = Mutex::new(Vec::new());

/// Numbers with unspecified initial values. Their memory is reused after they are dropped.
#[derive(Debug)]
pub(in crate::nn) struct KeptMemory(Vec<f32>);

impl KeptMemory {
    /// Takes memory for this many numbers.
    pub(super) fn take(len: usize) -> Self {
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
    pub(super) fn zeros(len: usize) -> Self {
        let mut memory = Self::take(len);
        memory.fill(0.0);
        memory
    }

    /// Returns the numbers, for a tensor. [`Self::leave`] brings the memory back.
    pub(super) fn into_vec(mut self) -> Vec<f32> {
        std::mem::take(&mut self.0)
    }

    /// Gives memory back for reuse.
    pub(in crate::nn) fn leave(numbers: Vec<f32>) {
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

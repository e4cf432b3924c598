//! Memory that one pass leaves to the next: pages that are new to the system cost as much as the sums that fill them.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// Most pieces that wait to be taken.
const MOST: usize = 48;

static WAITING: Mutex<Vec<Vec<f32>>> = Mutex::new(Vec::new());

/// Numbers of which nothing is known before they are written. They are left to others when it is dropped.
#[derive(Debug)]
pub(super) struct KeptMemory {
    /// At least `len`.
    numbers: Vec<f32>,
    len: usize,
}

impl KeptMemory {
    /// So many numbers.
    pub(super) fn take(len: usize) -> Self {
        let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
        // The smallest that is large enough; what is much larger waits for others.
        let fits = |numbers: &Vec<f32>| (len..=2 * len).contains(&numbers.len());
        let places = (0..waiting.len()).filter(|place| fits(&waiting[*place]));
        let place = places.min_by_key(|place| waiting[*place].len());
        let found = place.map(|place| waiting.swap_remove(place));
        drop(waiting);
        Self { numbers: found.unwrap_or_else(|| vec![0.0; len]), len }
    }

    /// So many zeros.
    pub(super) fn zeros(len: usize) -> Self {
        let mut memory = Self::take(len);
        memory.fill(0.0);
        memory
    }
}

impl Drop for KeptMemory {
    fn drop(&mut self) {
        let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.push(std::mem::take(&mut self.numbers));
        if waiting.len() > MOST {
            // The one that has waited longest: nobody asks for its size any more.
            waiting.remove(0);
        }
    }
}

impl Deref for KeptMemory {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.numbers[..self.len]
    }
}

impl DerefMut for KeptMemory {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.numbers[..self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_has_the_length_that_is_asked_for_whatever_waits() {
        for len in [7, 3, 900, 0, 8, 901, 500] {
            let mut memory = KeptMemory::take(len);
            assert_eq!(memory.len(), len);
            memory.fill(1.0);
            assert!(KeptMemory::zeros(len).iter().all(|x| *x == 0.0));
        }
        let several: Vec<KeptMemory> = (0..2 * MOST).map(|_| KeptMemory::take(5)).collect();
        drop(several);
        assert!(WAITING.lock().expect("sound").len() <= MOST);
    }
}

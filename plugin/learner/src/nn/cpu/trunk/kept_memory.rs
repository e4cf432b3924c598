//! Memory that one pass leaves to the next: pages that are new to the system cost as much as the convolutions.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// Most pieces that wait to be taken.
const MOST: usize = 4;

static WAITING: Mutex<Vec<Vec<f32>>> = Mutex::new(Vec::new());

/// Numbers of which nothing is known before they are written. They are left to others when it is dropped.
#[derive(Debug)]
pub(super) struct KeptMemory(Vec<f32>);

impl KeptMemory {
    /// So many numbers.
    pub(super) fn take(len: usize) -> Self {
        let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
        // The smallest that is large enough, else the largest.
        let fit = |place: &usize| (waiting[*place].len() < len, waiting[*place].len().abs_diff(len));
        let mut numbers = (0..waiting.len()).min_by_key(fit).map_or_else(Vec::new, |place| waiting.swap_remove(place));
        drop(waiting);
        if numbers.len() < len {
            // Nothing needs to be copied.
            numbers = Vec::new();
        }
        numbers.resize(len, 0.0);
        Self(numbers)
    }
}

impl Drop for KeptMemory {
    fn drop(&mut self) {
        let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.push(std::mem::take(&mut self.0));
        if waiting.len() > MOST
            && let Some(place) = (0..waiting.len()).min_by_key(|place| waiting[*place].len())
        {
            waiting.swap_remove(place);
        }
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
        for len in [7, 3, 900, 0, 8, 901] {
            let mut memory = KeptMemory::take(len);
            assert_eq!(memory.len(), len);
            memory.fill(1.0);
        }
        let several: Vec<KeptMemory> = (0..2 * MOST).map(|_| KeptMemory::take(5)).collect();
        drop(several);
        assert!(WAITING.lock().expect("sound").len() <= MOST);
    }
}

//! Memory and weights that one pass hands to the next: new pages from the system cost as much as the sums that fill
//! them, and weights for a few rows take longer to bring into order than to multiply with.

use crate::{
    among_workers::{Restore, are_awake, helpers, share_pieces},
    host_numbers::HostNumbers,
};
use burn::backend::tensor::FloatTensor;
use std::{
    any::{Any, TypeId},
    borrow::Cow,
    cell::RefCell,
    collections::BTreeMap,
    ops::{Deref, DerefMut},
    sync::{Arc, Mutex, PoisonError},
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

// Weights of networks that do not change.

thread_local! {
    /// The weights of the network that this thread computes, if they do not change.
    static NETWORK: RefCell<Option<KeptWeights>> = const { RefCell::new(None) };
}

/// The weights of a network that does not change, in the orders in which products read them. Clones share them.
///
/// Without it each pass orders them anew. For a few rows that takes most of the time.
#[derive(Clone, Debug, Default)]
pub struct KeptWeights(Arc<Mutex<BTreeMap<Key, Ordered>>>);

/// Address and length of the numbers, and the type that they are ordered in.
type Key = (usize, usize, TypeId);

#[derive(Debug)]
struct Ordered {
    weights: Arc<dyn Any + Send + Sync>,
    /// The tensor that they were made of. While it is here no other one has its address, and its numbers do not change.
    _of: Box<dyn Any + Send + Sync>,
}

impl KeptWeights {
    /// Runs passes of the network on this thread.
    pub fn during<T>(&self, passes: impl FnOnce() -> T) -> T {
        let _until_the_end = Restore::after(&NETWORK, Some(self.clone()));
        passes()
    }

    /// Returns whether this thread computes a network that does not change.
    pub(crate) fn are_here() -> bool {
        NETWORK.with_borrow(Option::is_some)
    }

    /// Returns the weights as `ordered`, or as an earlier pass has ordered them.
    pub(crate) fn of<B: HostNumbers, T: Send + Sync + 'static>(
        weights: &FloatTensor<B>,
        ordered: impl FnOnce() -> T,
    ) -> Arc<T> {
        let numbers = B::numbers(weights);
        let (Some(Self(kept)), Cow::Borrowed(numbers)) = (NETWORK.with_borrow(Clone::clone), numbers) else {
            return Arc::new(ordered());
        };
        let key = (numbers.as_ptr().addr(), numbers.len(), TypeId::of::<T>());
        // Other threads wait: they need the same.
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(Ok(found)) = kept.get(&key).map(|found| Arc::clone(&found.weights).downcast()) {
            return found;
        }
        let ordered = Arc::new(ordered());
        kept.insert(key, Ordered { weights: ordered.clone(), _of: Box::new(weights.clone()) });
        ordered
    }
}

// Distribution of work among threads.

/// Number of products below which a second thread costs more than it saves: waking one takes as long as a million of
/// them.
const FEW: usize = 1 << 22;

/// The same limit where other threads are awake.
const FEW_AWAKE: usize = 1 << 18;

/// Least number of products for each thread where others are awake.
const OWN: usize = 1 << 17;

/// Number of products that take as long as moving a number.
pub const OF_A_MOVE: usize = 8;

/// Calls `work` with each piece of `len` items and its number, on all threads if there are many products in all. The
/// pieces do not depend on the number of threads.
pub fn share<T: Send>(items: &mut [T], len: usize, products: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    share_with(items, len, products, || (), |(), piece, items| work(piece, items));
}

/// Does [`share`] for items that are pieces already.
pub fn share_each<T: Send>(items: &mut [T], products: usize, work: impl Fn(usize, &mut T) + Sync) {
    share(items, 1, products, |piece, items| items.iter_mut().for_each(|item| work(piece, item)));
}

/// Does [`share`] with memory for each thread, which `state` makes. Results must not depend on what other pieces have
/// left in it.
pub(crate) fn share_with<T: Send, S>(
    items: &mut [T],
    len: usize,
    products: usize,
    state: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, usize, &mut [T]) + Sync,
) {
    let count = items.len().div_ceil(len);
    let most = match are_awake() {
        true if products >= FEW_AWAKE => products / OWN - 1,
        false if products >= FEW => usize::MAX,
        _ => 0,
    };
    let pieces = items.chunks_mut(len).enumerate();
    share_pieces(pieces, helpers(count, most), state, |state, (piece, items)| work(state, piece, items));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host_numbers::tensor;
    use burn::backend::Flex;

    #[test]
    fn weights_are_ordered_once_for_each_network_and_order() {
        let tensor = |number: f32| tensor::<Flex>(vec![number; 8], [8], &Default::default());
        let (one, other) = (tensor(1.0), tensor(2.0));
        let (kept, mut times) = (KeptWeights::default(), 0);
        let mut sum_of = |weights: &FloatTensor<Flex>| {
            let sum = KeptWeights::of::<Flex, f32>(weights, || {
                times += 1;
                Flex::numbers(weights).iter().sum::<f32>()
            });
            (*sum, times)
        };
        assert!(!KeptWeights::are_here());
        assert_eq!([sum_of(&one), sum_of(&one.clone())], [(8.0, 1), (8.0, 2)]);
        kept.during(|| {
            assert!(KeptWeights::are_here());
            assert_eq!([sum_of(&one), sum_of(&other)], [(8.0, 3), (16.0, 4)]);
            assert_eq!([sum_of(&one.clone()), sum_of(&other)], [(8.0, 4), (16.0, 4)]);
            // These are gone at once, and no later one takes their place.
            assert_eq!([3.0, 4.0, 5.0].map(|number| sum_of(&tensor(number)).0), [24.0, 32.0, 40.0]);
            KeptWeights::default().during(|| assert_eq!(sum_of(&one), (8.0, 8)));
        });
        kept.clone().during(|| assert_eq!(sum_of(&one), (8.0, 8)));
        let count = kept.during(|| KeptWeights::of::<Flex, usize>(&one, || 7));
        assert_eq!(*count, 7, "another order");
    }

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

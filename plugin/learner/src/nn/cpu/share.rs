//! Distribution of work among threads.

use crate::are_awake;
use rayon::prelude::*;

/// Number of products below which a second thread costs more than it saves: waking one takes as long as a million of
/// them.
const FEW: usize = 1 << 22;
/// The same limit where other threads are awake.
const FEW_AWAKE: usize = 1 << 18;
/// Number of products that take as long as moving a number.
pub(crate) const OF_A_MOVE: usize = 8;

/// Calls `work` with each piece of `len` items and its number, on all threads if there are many products in all.
pub(crate) fn share<T: Send>(items: &mut [T], len: usize, products: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    if products < if are_awake() { FEW_AWAKE } else { FEW } {
        items.chunks_mut(len).enumerate().for_each(|(piece, items)| work(piece, items));
    } else {
        items.par_chunks_mut(len).enumerate().for_each(|(piece, items)| work(piece, items));
    }
}

/// Does [`share`] for items that are pieces already.
pub(crate) fn share_each<T: Send>(items: &mut [T], products: usize, work: impl Fn(usize, &mut T) + Sync) {
    share(items, 1, products, |piece, items| items.iter_mut().for_each(|item| work(piece, item)));
}

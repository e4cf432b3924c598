//! Destinations for the sums of a convolution.
//!
//! These are no closures: only code that is certainly inlined is compiled for the vectors of the loops around it.

use super::relu::{relu, relu_backward};
use super::tile::{LANES, Lanes};

/// Gets the sums of a pixel's channels, up to 16 at a time.
pub(super) trait Store {
    /// Stores sums: the position of the first channel in the image, the number of channels from it on, and the sums.
    fn store(&mut self, at: usize, count: usize, sums: &Lanes);
}

/// Writes the sums.
pub(super) struct Write<'a>(pub(super) &'a mut [f32]);

/// Writes the ReLU of the sums.
pub(super) struct WriteRelu<'a>(pub(super) &'a mut [f32]);

/// Adds the sums.
pub(super) struct Add<'a>(pub(super) &'a mut [f32]);

/// Adds the sums to the first slice as gradients of a ReLU whose output was the second.
pub(super) struct AddWhere<'a>(pub(super) &'a mut [f32], pub(super) &'a [f32]);

impl Store for Write<'_> {
    #[inline(always)]
    fn store(&mut self, at: usize, count: usize, sums: &Lanes) {
        put(self.0, at, count, sums, |to, sum| *to = sum);
    }
}

impl Store for WriteRelu<'_> {
    #[inline(always)]
    fn store(&mut self, at: usize, count: usize, sums: &Lanes) {
        put(self.0, at, count, sums, |to, sum| *to = relu(sum));
    }
}

impl Store for Add<'_> {
    #[inline(always)]
    fn store(&mut self, at: usize, count: usize, sums: &Lanes) {
        put(self.0, at, count, sums, |to, sum| *to += sum);
    }
}

impl Store for AddWhere<'_> {
    #[inline(always)]
    fn store(&mut self, at: usize, count: usize, sums: &Lanes) {
        let (to, mask) = (&mut self.0[at..], &self.1[at..]);
        match (to.first_chunk_mut::<LANES>(), mask.first_chunk::<LANES>()) {
            (Some(to), Some(mask)) if count >= LANES => {
                for l in 0..LANES {
                    to[l] += relu_backward(mask[l], sums[l]);
                }
            }
            _ => {
                let pairs = to[..count.min(LANES)].iter_mut().zip(mask).zip(sums);
                pairs.for_each(|((to, &mask), &x)| *to += relu_backward(mask, x));
            }
        }
    }
}

/// Changes `count` numbers from `at` on (at most 16) with those of `lanes`.
#[inline(always)]
fn put(to: &mut [f32], at: usize, count: usize, lanes: &Lanes, change: impl Fn(&mut f32, f32)) {
    let to = &mut to[at..];
    match to.first_chunk_mut::<LANES>() {
        Some(to) if count >= LANES => {
            for l in 0..LANES {
                change(&mut to[l], lanes[l]);
            }
        }
        _ => to[..count.min(LANES)].iter_mut().zip(lanes).for_each(|(to, &x)| change(to, x)),
    }
}

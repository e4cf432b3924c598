//! Sums over the windows of an image: the gradients of a convolution's weights and biases.

use super::tile::{LANES, Lanes, ROWS, WIDE_ROWS, Window, fused, is_wide, lanes_at};
use macerator::Simd;

/// Pixels after which [`outer`] goes on to other weights, while these pixels are in the first-level cache.
const BLOCK: usize = 128;
/// Numbers of a row of a 3×3 window with three colours: few enough to be taken at once.
const COLOURS: usize = 9;

/// Adds to `sums` the products of each window's numbers with the `channels` numbers of `y` that go with the window,
/// summed over the windows: the gradient of [`correlate`](super::tile::correlate)'s weights, in their order.
#[macerator::with_simd]
pub(super) fn outer<S: Simd>(
    x: &[f32],
    starts: &[usize],
    window: Window,
    y: &[f32],
    places: &[usize],
    sums: &mut [Lanes],
) {
    {
        let rows = window.count * window.len;
        for (starts, places) in starts.chunks(BLOCK).zip(places.chunks(BLOCK)) {
            let pairs = Pairs { x, starts, places };
            let mut block = 0;
            if is_wide::<S>() {
                for sums in sums.chunks_exact_mut(2 * rows) {
                    let (one, other) = sums.split_at_mut(rows);
                    let pieces = one.chunks_exact_mut(window.len).zip(other.chunks_exact_mut(window.len));
                    for (piece, (one, other)) in pieces.enumerate() {
                        let tiles = one.chunks_mut(WIDE_ROWS).zip(other.chunks_mut(WIDE_ROWS));
                        for (tile, (one, other)) in tiles.enumerate() {
                            let first = piece * window.step + tile * WIDE_ROWS;
                            pairs.add_pair::<S, WIDE_ROWS>(first, &y[block * LANES..], one, other);
                        }
                    }
                    block += 2;
                }
            }
            for sums in sums[block * rows..].chunks_exact_mut(rows) {
                for (piece, sums) in sums.chunks_exact_mut(window.len).enumerate() {
                    let (first, y) = (piece * window.step, &y[block * LANES..]);
                    if is_wide::<S>() && window.len == COLOURS {
                        pairs.add::<S, COLOURS>(first, y, sums);
                    } else {
                        for (tile, sums) in sums.chunks_mut(ROWS).enumerate() {
                            pairs.add::<S, ROWS>(first + tile * ROWS, y, sums);
                        }
                    }
                }
                block += 1;
            }
        }
    }
}

/// Windows, and the pixels that go with them.
struct Pairs<'a> {
    x: &'a [f32],
    starts: &'a [usize],
    places: &'a [usize],
}

#[allow(clippy::needless_range_loop, reason = "with iterators the sums do not stay in registers")]
impl Pairs<'_> {
    /// Adds the products of up to `P` numbers of each window, from the one with this number on, to their sums.
    #[inline(always)]
    fn add<S: Simd, const P: usize>(&self, first: usize, y: &[f32], sums: &mut [Lanes]) {
        let mut tile = [[0.0; LANES]; P];
        for p in 0..P {
            if p < sums.len() {
                tile[p] = sums[p];
            }
        }
        for (&start, &place) in self.starts.iter().zip(self.places) {
            let (at, y) = (start + first, *lanes_at(y, place));
            for p in 0..P {
                let x = self.x[at + p];
                for l in 0..LANES {
                    tile[p][l] = fused::<S>(x, y[l], tile[p][l]);
                }
            }
        }
        for p in 0..P {
            if p < sums.len() {
                sums[p] = tile[p];
            }
        }
    }

    /// Does [`Self::add`] for two blocks at once.
    #[inline(always)]
    fn add_pair<S: Simd, const P: usize>(&self, first: usize, y: &[f32], one: &mut [Lanes], other: &mut [Lanes]) {
        let (mut tile0, mut tile1) = ([[0.0; LANES]; P], [[0.0; LANES]; P]);
        for p in 0..P {
            if p < one.len() && p < other.len() {
                (tile0[p], tile1[p]) = (one[p], other[p]);
            }
        }
        for (&start, &place) in self.starts.iter().zip(self.places) {
            let (at, y0, y1) = (start + first, *lanes_at(y, place), *lanes_at(y, place + LANES));
            for p in 0..P {
                let x = self.x[at + p];
                for l in 0..LANES {
                    tile0[p][l] = fused::<S>(x, y0[l], tile0[p][l]);
                }
                for l in 0..LANES {
                    tile1[p][l] = fused::<S>(x, y1[l], tile1[p][l]);
                }
            }
        }
        for p in 0..P {
            if p < one.len() && p < other.len() {
                (one[p], other[p]) = (tile0[p], tile1[p]);
            }
        }
    }
}

/// Adds the `channels` numbers at each of `places` to `sums`.
#[macerator::with_simd]
#[allow(clippy::extra_unused_type_parameters, reason = "S says which instructions the loop is compiled for")]
pub(super) fn column_sums<S: Simd>(y: &[f32], places: &[usize], sums: &mut [Lanes]) {
    {
        for (block, sums) in sums.iter_mut().enumerate() {
            let y = &y[block * LANES..];
            let mut total = *sums;
            for &place in places {
                total.iter_mut().zip(lanes_at(y, place)).for_each(|(sum, y)| *sum += y);
            }
            *sums = total;
        }
    }
}

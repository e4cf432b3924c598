//! Sums of products for a few pixels and 16 channels at once, so that the sums stay in registers. Most of the time
//! goes here.
//!
//! Each sum is made by fused multiply-adds in a fixed order. It does not depend on the rest of the tile, on the width
//! of vectors, on threads, or on whether the machine has such instructions.

use crate::instructions::macerator::{self, Scalar, Simd, VFma};

/// Number of channels at a time.
pub(crate) const LANES: usize = 16;

/// Number of rows at a time: with two vectors of 8 lanes each, the sums take 12 of 16 registers.
pub(crate) const ROWS: usize = 6;

/// Number of rows at a time where a vector has all lanes and there are 32 registers; more leave too few for their
/// addresses.
pub(crate) const WIDE_ROWS: usize = 8;

/// A number for each of [`LANES`] channels.
pub(crate) type Lanes = [f32; LANES];

/// The extent of a window: `count` pieces of `len` numbers, at a distance of `step`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    pub(crate) count: usize,
    pub(crate) step: usize,
    pub(crate) len: usize,
}

/// Computes the sums of a window's numbers times `weights`, for the windows of `x` that begin at `starts`.
///
/// `weights` has `count * len` rows for each block of 16 channels, and the sums of each block start from `first`.
/// `store` gets the number of the window, the block and the sums. For each block it gets all windows in order, or,
/// where allowed, those of two blocks in turn, which is faster.
#[macerator::with_simd]
pub(crate) fn correlate<S: Simd, F: Fn(usize) -> Lanes, G: FnMut(usize, usize, &Lanes)>(
    x: &[f32],
    starts: &[usize],
    window: Window,
    weights: &[Lanes],
    first: F,
    in_turn: bool,
    store: G,
) {
    let mut store = store;
    {
        let rows = window.count * window.len;
        let mut block = 0;
        if is_wide::<S>() && in_turn {
            for weights in weights.chunks_exact(2 * rows) {
                let (one, other) = weights.split_at(rows);
                pair_strip::<S, WIDE_ROWS, _>(
                    x,
                    starts,
                    window,
                    [one, other],
                    [first(block), first(block + 1)],
                    block,
                    &mut store,
                );
                block += 2;
            }
        }
        for weights in weights[block * rows..].chunks_exact(rows) {
            if is_wide::<S>() {
                strip::<S, WIDE_ROWS, _>(x, starts, window, weights, first(block), block, &mut store);
            } else {
                strip::<S, ROWS, _>(x, starts, window, weights, first(block), block, &mut store);
            }
            block += 1;
        }
    }
}

/// Returns whether a vector has room for all lanes; then there are 32 of them.
#[inline(always)]
pub(crate) fn is_wide<S: Simd>() -> bool {
    f32::lanes::<S>() >= LANES
}

/// Returns the channels that begin at a position.
#[inline(always)]
pub(crate) fn lanes_at(x: &[f32], at: usize) -> &Lanes {
    let Some(lanes) = x[at..].first_chunk::<LANES>() else { unreachable!("images have slack behind their last pixel") };
    lanes
}

/// Computes the sums of all windows for a block, tile by tile.
#[inline(always)]
fn strip<S: Simd, const P: usize, G: FnMut(usize, usize, &Lanes)>(
    x: &[f32],
    starts: &[usize],
    window: Window,
    weights: &[Lanes],
    first: Lanes,
    block: usize,
    store: &mut G,
) {
    for (tile, starts) in starts.chunks(P).enumerate() {
        let mut at = [starts[0]; P];
        at[..starts.len()].copy_from_slice(starts);
        let sums = tile_sums::<S, P>(x, at, window, weights, first);
        for (p, sums) in sums.iter().enumerate() {
            if p < starts.len() {
                store(tile * P + p, block, sums);
            }
        }
    }
}

/// Does [`strip`] for two blocks at once, and reads the windows only once.
///
/// It is separate from [`strip`], since the sums of several blocks in one array do not stay in registers, which takes
/// twice as long.
#[inline(always)]
fn pair_strip<S: Simd, const P: usize, G: FnMut(usize, usize, &Lanes)>(
    x: &[f32],
    starts: &[usize],
    window: Window,
    weights: [&[Lanes]; 2],
    first: [Lanes; 2],
    block: usize,
    store: &mut G,
) {
    for (tile, starts) in starts.chunks(P).enumerate() {
        let mut at = [starts[0]; P];
        at[..starts.len()].copy_from_slice(starts);
        let (one, other) = pair_sums::<S, P>(x, at, window, weights, first);
        for p in 0..P {
            if p < starts.len() {
                store(tile * P + p, block, &one[p]);
                store(tile * P + p, block + 1, &other[p]);
            }
        }
    }
}

/// Returns x y + z, rounded once.
#[inline(always)]
pub(crate) fn fused<S: Simd>(x: f32, y: f32, z: f32) -> f32 {
    if f32::is_accelerated::<S>() { x.mul_add(y, z) } else { fused_of_doubles(x, y, z) }
}

/// Does [`fused`] by sums of doubles, which every machine has.
///
/// The product is exact as a double. The sum is rounded to odd: where it is not exact, its last bit is 1. So it lies on the
/// right side of every middle between two `f32`s, and the second rounding does what a single one would (Boldo and Melquiond
/// 2008, "Emulation of a FMA and correctly rounded sums: proved algorithms using rounding to odd").
#[inline(always)]
fn fused_of_doubles(x: f32, y: f32, z: f32) -> f32 {
    let (product, z) = (f64::from(x) * f64::from(y), f64::from(z));
    let sum = product + z;
    // What the rounding of the sum has cut off (Knuth), exactly; NaN if the sum is not finite.
    let of_z = sum - product;
    let rest = (product - (sum - of_z)) + (z - of_z);
    let bits = sum.to_bits();
    // A step of an even number towards the exact sum, away from 0 or nearer to it.
    let step = if (rest > 0.0) == (sum > 0.0) { 1 } else { u64::MAX };
    let is_between = rest.abs() > 0.0 && bits & 1 == 0;
    f64::from_bits(if is_between { bits.wrapping_add(step) } else { bits }) as f32
}

#[inline(always)]
fn tile_sums<S: Simd, const P: usize>(
    x: &[f32],
    at: [usize; P],
    window: Window,
    weights: &[Lanes],
    first: Lanes,
) -> [Lanes; P] {
    let mut sums = [first; P];
    for (piece, weights) in weights.chunks_exact(window.len).enumerate() {
        let mut rows = [&x[..0]; P];
        for p in 0..P {
            rows[p] = &x[at[p] + piece * window.step..][..weights.len()];
        }
        for (k, &weights) in weights.iter().enumerate() {
            for p in 0..P {
                let x = rows[p][k];
                for j in 0..LANES {
                    sums[p][j] = fused::<S>(x, weights[j], sums[p][j]);
                }
            }
        }
    }
    sums
}

#[inline(always)]
fn pair_sums<S: Simd, const P: usize>(
    x: &[f32],
    at: [usize; P],
    window: Window,
    weights: [&[Lanes]; 2],
    first: [Lanes; 2],
) -> ([Lanes; P], [Lanes; P]) {
    let (mut one, mut other) = ([first[0]; P], [first[1]; P]);
    let pieces = weights[0].chunks_exact(window.len).zip(weights[1].chunks_exact(window.len));
    for (piece, (weights0, weights1)) in pieces.enumerate() {
        let mut rows = [&x[..0]; P];
        for p in 0..P {
            rows[p] = &x[at[p] + piece * window.step..][..weights0.len()];
        }
        for (k, (&weights0, &weights1)) in weights0.iter().zip(weights1).enumerate() {
            for p in 0..P {
                let x = rows[p][k];
                for j in 0..LANES {
                    one[p][j] = fused::<S>(x, weights0[j], one[p][j]);
                }
                for j in 0..LANES {
                    other[p][j] = fused::<S>(x, weights1[j], other[p][j]);
                }
            }
        }
    }
    (one, other)
}

// Sums over the windows of an image: the gradients of a convolution's weights and biases.

/// Pixels after which [`outer`] goes on to other weights, while these pixels are in the first-level cache.
const BLOCK: usize = 128;

/// Numbers of a row of a 3×3 window with three colours: few enough to be taken at once.
const COLOURS: usize = 9;

/// Adds to `sums` the products of each window's numbers with the `channels` numbers of `y` that go with the window,
/// summed over the windows. That is the gradient of [`correlate`]'s weights, in their order.
#[macerator::with_simd]
pub(crate) fn outer<S: Simd>(
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
pub(crate) fn column_sums<S: Simd>(y: &[f32], places: &[usize], sums: &mut [Lanes]) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_learner::rng::{Streams, below, unit};

    #[test]
    fn doubles_round_a_multiply_add_once() {
        let mut rng = Streams::new(1).stream("fused", 0);
        let mut twice = 0;
        for case in 0..2_000_000 {
            let [x, y, any] = [(); 3].map(|()| f32::from_bits(below(&mut rng, 1 << 32) as u32));
            let z = match case % 3 {
                // About as large as the product, so that bits meet.
                0 => -x * y * (1.0 + f32::EPSILON * (8.0 * unit(&mut rng) - 4.0) as f32),
                1 => x * y * 2f32.powi(below(&mut rng, 30) as i32 - 15) * (1.0 + unit(&mut rng) as f32),
                _ => any,
            };
            let (want, got) = (x.mul_add(y, z), fused_of_doubles(x, y, z));
            assert!(
                got.to_bits() == want.to_bits() || got.is_nan() && want.is_nan(),
                "{x:e} {y:e} {z:e}: {got:e}, {want:e}"
            );
            twice += u32::from((x * y + z).to_bits() != want.to_bits());
        }
        assert!(twice > 100_000, "only {twice} cases tell one rounding from two");
    }

    #[test]
    fn a_sum_just_beside_a_middle_is_rounded_to_its_side() {
        // 1 + 2^-24 lies in the middle between two numbers, and the product moves it by less than a double tells.
        let (middle, tiny) = (1.0 + f32::EPSILON, 2f32.powi(-60));
        for sign in [1.0, -1.0] {
            let (x, y, z) = (f32::EPSILON / 2.0, 1.0 + sign * f32::EPSILON, middle);
            assert_eq!(fused_of_doubles(x, y, z), x.mul_add(y, z));
            assert_eq!(fused_of_doubles(sign * tiny, tiny, 1.0), (sign * tiny).mul_add(tiny, 1.0));
        }
        assert_eq!(fused_of_doubles(1.0, -0.0, 0.0).to_bits(), 0.0f32.to_bits());
        assert_eq!(fused_of_doubles(f32::MAX, 2.0, f32::NEG_INFINITY), f32::NEG_INFINITY);
        assert_eq!(fused_of_doubles(f32::MAX, 2.0, 0.0), f32::INFINITY);
        assert!(fused_of_doubles(f32::INFINITY, 0.0, 1.0).is_nan());
    }
}

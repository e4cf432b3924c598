//! Sums of products for a few pixels and 16 channels at once, so that the sums stay in registers. Most of the time
//! goes here.
//!
//! Each sum is made by fused multiply-adds in a fixed order: it does not depend on the rest of the tile, on the width
//! of vectors, or on threads. A machine without such instructions rounds twice, and its last bits differ.

use macerator::{Scalar, Simd, VFma};

/// Number of channels at a time.
pub(super) const LANES: usize = 16;
/// Number of rows at a time: with two vectors of 8 lanes each, the sums take 12 of 16 registers.
pub(super) const ROWS: usize = 6;
/// Number of rows at a time where a vector has all lanes and there are 32 registers; more leave too few for their
/// addresses.
pub(super) const WIDE_ROWS: usize = 8;

/// A number for each of [`LANES`] channels.
pub(super) type Lanes = [f32; LANES];

/// The extent of a window: `count` pieces of `len` numbers, at a distance of `step`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub(super) count: usize,
    pub(super) step: usize,
    pub(super) len: usize,
}

/// Computes the sums of a window's numbers times `weights`, for the windows of `x` that begin at `starts`.
///
/// `weights` has `count * len` rows for each block of 16 channels, and the sums of each block start from `first`.
/// `store` gets the number of the window, the block and the sums. For each block it gets all windows in order, or,
/// where allowed, those of two blocks in turn, which is faster.
#[macerator::with_simd]
pub(super) fn correlate<S: Simd, F: Fn(usize) -> Lanes, G: FnMut(usize, usize, &Lanes)>(
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
pub(super) fn is_wide<S: Simd>() -> bool {
    f32::lanes::<S>() >= LANES
}

/// Returns the channels that begin at a position.
#[inline(always)]
pub(super) fn lanes_at(x: &[f32], at: usize) -> &Lanes {
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

/// Returns x y + z, rounded once where the machine can.
#[inline(always)]
pub(super) fn fused<S: Simd>(x: f32, y: f32, z: f32) -> f32 {
    if f32::is_accelerated::<S>() { x.mul_add(y, z) } else { x * y + z }
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

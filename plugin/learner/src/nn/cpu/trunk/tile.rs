//! The two loops in which all the time goes: sums of products for a few pixels and 16 channels at once, so that the
//! sums stay in registers.
//!
//! Each sum is made by fused multiply-adds in an order of its own: it does not depend on what else is in the tile, on
//! the width of vectors, or on threads.

use macerator::{Simd, VFma};

/// Channels at a time.
pub(super) const LANES: usize = 16;
/// Pixels (or weights) at a time: with two vectors of 8 lanes each, the sums take 12 of 16 registers.
const ROWS: usize = 6;
/// Pixels after which [`outer`] goes on to other weights, while these pixels are in the first-level cache.
const BLOCK: usize = 128;

/// A number for each of [`LANES`] channels.
pub(super) type Lanes = [f32; LANES];

/// What a window sees: `count` pieces of `len` numbers, from one to the next `step`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub(super) count: usize,
    pub(super) step: usize,
    pub(super) len: usize,
}

/// The sums of a window's numbers times `weights`, for the windows of `x` that begin at `starts`.
///
/// `weights` has `count * len` rows for each block of 16 channels, `first` what the sums of each block start from.
/// `store` gets the number of the window, the block and the sums.
#[macerator::with_simd]
pub(super) fn correlate<S: Simd, F: Fn(usize) -> Lanes, G: FnMut(usize, usize, &Lanes)>(
    x: &[f32],
    starts: &[usize],
    window: Window,
    weights: &[Lanes],
    first: F,
    store: G,
) {
    let mut store = store;
    {
        for (block, weights) in weights.chunks_exact(window.count * window.len).enumerate() {
            let first = first(block);
            for (tile, starts) in starts.chunks(ROWS).enumerate() {
                let mut at = [starts[0]; ROWS];
                at[..starts.len()].copy_from_slice(starts);
                let sums = tile_sums::<S>(x, at, window, weights, first);
                for (p, sums) in sums.iter().enumerate() {
                    if p < starts.len() {
                        store(tile * ROWS + p, block, sums);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn fused<S: Simd>(x: f32, y: f32, z: f32) -> f32 {
    if f32::is_accelerated::<S>() { x.mul_add(y, z) } else { x * y + z }
}

#[inline(always)]
fn tile_sums<S: Simd>(x: &[f32], at: [usize; ROWS], window: Window, weights: &[Lanes], first: Lanes) -> [Lanes; ROWS] {
    let mut sums = [first; ROWS];
    for (piece, weights) in weights.chunks_exact(window.len).enumerate() {
        let mut rows = [&x[..0]; ROWS];
        for p in 0..ROWS {
            rows[p] = &x[at[p] + piece * window.step..][..weights.len()];
        }
        for (k, &weights) in weights.iter().enumerate() {
            for p in 0..ROWS {
                let x = rows[p][k];
                for j in 0..LANES {
                    sums[p][j] = fused::<S>(x, weights[j], sums[p][j]);
                }
            }
        }
    }
    sums
}

/// Adds to `sums` the products of each window's numbers with the `channels` numbers of `y` that go with the window,
/// summed over the windows: the gradient of [`correlate`]'s weights, in their order.
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
        for (starts, places) in starts.chunks(BLOCK).zip(places.chunks(BLOCK)) {
            for (block, sums) in sums.chunks_exact_mut(window.count * window.len).enumerate() {
                for (piece, sums) in sums.chunks_exact_mut(window.len).enumerate() {
                    for (tile, sums) in sums.chunks_mut(ROWS).enumerate() {
                        let x = &x[piece * window.step + tile * ROWS..];
                        tile_outer::<S>(x, starts, &y[block * LANES..], places, sums);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn tile_outer<S: Simd>(x: &[f32], starts: &[usize], y: &[f32], places: &[usize], sums: &mut [Lanes]) {
    let mut tile = [[0.0; LANES]; ROWS];
    for p in 0..ROWS {
        if p < sums.len() {
            tile[p] = sums[p];
        }
    }
    for (&start, &place) in starts.iter().zip(places) {
        let (Some(x), Some(y)) = (x[start..].first_chunk::<ROWS>(), y[place..].first_chunk::<LANES>()) else {
            unreachable!("images have slack behind their last pixel");
        };
        for p in 0..ROWS {
            for j in 0..LANES {
                tile[p][j] = fused::<S>(x[p], y[j], tile[p][j]);
            }
        }
    }
    for p in 0..ROWS {
        if p < sums.len() {
            sums[p] = tile[p];
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
                if let Some(y) = y[place..].first_chunk::<LANES>() {
                    total.iter_mut().zip(y).for_each(|(sum, y)| *sum += y);
                }
            }
            *sums = total;
        }
    }
}

//! Products of small matrices, for [`winograd`](super::winograd).
//!
//! As in [`tile`](crate::tile), each sum is made by fused multiply-adds in a fixed order, whatever the width of
//! vectors.

#![allow(clippy::needless_range_loop, reason = "indices by number keep sums in registers, and look alike")]

use crate::{
    instructions::macerator::{self, Simd, Vector},
    tile::{LANES, Lanes, Part, is_wide, parts, row_of, write_row},
};

/// Number of rows at a time where a vector has all lanes: with two blocks of channels the sums take 16 of 32
/// registers.
const WIDE_ROWS: usize = 8;

/// Number of rows at a time otherwise: with two vectors for each, the sums take 8 of 16 registers.
const ROWS: usize = 4;

/// The layout of matrices with a row for each tile: one matrix for each point of a transformed tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct Matrices {
    /// Number of rows.
    pub(super) rows: usize,
    /// Numbers of a row, in blocks of 16.
    pub(super) columns: usize,
    /// Distance from the first number of one matrix to that of the next.
    pub(super) step: usize,
}

/// Computes into `m`, for each point, the product of its matrix in `v` and its `weights`, which lie in blocks of 16
/// columns.
#[macerator::with_simd]
pub(super) fn products<S: Simd>(v: &[f32], from: Matrices, weights: &[Lanes], m: &mut [f32], to: Matrices) {
    {
        let points = v.chunks_exact(from.step).zip(m.chunks_exact_mut(to.step));
        for ((v, m), weights) in points.zip(weights.chunks_exact(from.columns * to.columns / LANES)) {
            let v = &v[..from.rows * from.columns];
            let mut block = 0;
            if is_wide::<S>() {
                for weights in weights.chunks_exact(2 * from.columns) {
                    product::<Vector<S, f32>, WIDE_ROWS, 2>(v, from, weights, &mut m[block * LANES..], to);
                    block += 2;
                }
            }
            for weights in weights[block * from.columns..].chunks_exact(from.columns) {
                let m = &mut m[block * LANES..];
                match parts::<S>() {
                    Some(1) => product::<Vector<S, f32>, WIDE_ROWS, 1>(v, from, weights, m, to),
                    Some(2) => product::<Vector<S, f32>, ROWS, 2>(v, from, weights, m, to),
                    Some(4) => product::<Vector<S, f32>, ROWS, 4>(v, from, weights, m, to),
                    _ => product::<Lanes, ROWS, 1>(v, from, weights, m, to),
                }
                block += 1;
            }
        }
    }
}

/// Computes the blocks of columns that `N` parts fill, `P` rows at a time.
#[inline(always)]
fn product<T: Part, const P: usize, const N: usize>(
    v: &[f32],
    from: Matrices,
    weights: &[Lanes],
    to: &mut [f32],
    Matrices { columns, .. }: Matrices,
) {
    let width = from.columns;
    for first in (0..from.rows).step_by(P) {
        // The last row stands in for those behind it.
        let mut rows = [(0, &v[..0]); P];
        for p in 0..P {
            let row = (first + p).min(from.rows - 1);
            rows[p] = (row, &v[row * width..][..width]);
        }
        let mut sums = [[T::of(0.0); N]; P];
        for k in 0..width {
            let weights = row_of::<T, N>(weights, width, k);
            for p in 0..P {
                let x = T::of(rows[p].1[k]);
                for n in 0..N {
                    sums[p][n] = sums[p][n].plus(x, weights[n]);
                }
            }
        }
        for p in 0..P {
            for n in 0..N {
                sums[p][n].write(&mut to[rows[p].0 * columns + n * T::len()..]);
            }
        }
    }
}

/// For each point, adds the product of its transposed matrix in `v` and that in `grad` to its `sums`, which lie as
/// the weights of [`products`].
#[macerator::with_simd]
pub(super) fn add_products<S: Simd>(v: &[f32], from: Matrices, grad: &[f32], to: Matrices, sums: &mut [Lanes]) {
    {
        let points = v.chunks_exact(from.step).zip(grad.chunks_exact(to.step));
        for ((v, grad), sums) in points.zip(sums.chunks_exact_mut(from.columns * to.columns / LANES)) {
            let v = &v[..from.rows * from.columns];
            let mut block = 0;
            if is_wide::<S>() {
                for sums in sums.chunks_exact_mut(2 * from.columns) {
                    add_product::<Vector<S, f32>, WIDE_ROWS, 2>(v, from, &grad[block * LANES..], to, sums);
                    block += 2;
                }
            }
            for sums in sums[block * from.columns..].chunks_exact_mut(from.columns) {
                let grad = &grad[block * LANES..];
                match parts::<S>() {
                    Some(1) => add_product::<Vector<S, f32>, WIDE_ROWS, 1>(v, from, grad, to, sums),
                    Some(2) => add_product::<Vector<S, f32>, ROWS, 2>(v, from, grad, to, sums),
                    Some(4) => add_product::<Vector<S, f32>, ROWS, 4>(v, from, grad, to, sums),
                    _ => add_product::<Lanes, ROWS, 1>(v, from, grad, to, sums),
                }
                block += 1;
            }
        }
    }
}

/// Adds to the blocks of sums that `N` parts fill, `P` rows of them at a time.
#[inline(always)]
fn add_product<T: Part, const P: usize, const N: usize>(
    v: &[f32],
    from: Matrices,
    grad: &[f32],
    to: Matrices,
    sums: &mut [Lanes],
) {
    let inputs = from.columns;
    for first in (0..inputs).step_by(P) {
        let mut tile = [[T::of(0.0); N]; P];
        for p in 0..P {
            tile[p] = row_of(sums, inputs, first + p);
        }
        for row in 0..from.rows {
            let Some(x) = v[row * inputs + first..].first_chunk::<P>() else { unreachable!("rows are whole blocks") };
            let mut of_grad = [T::of(0.0); N];
            for n in 0..N {
                of_grad[n] = T::read(&grad[row * to.columns + n * T::len()..]);
            }
            for p in 0..P {
                let x = T::of(x[p]);
                for n in 0..N {
                    tile[p][n] = tile[p][n].plus(x, of_grad[n]);
                }
            }
        }
        for p in 0..P {
            write_row(tile[p], sums, inputs, first + p);
        }
    }
}

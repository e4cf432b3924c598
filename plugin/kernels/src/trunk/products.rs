//! Products of small matrices, for [`winograd`](super::winograd).
//!
//! As in [`tile`](crate::tile), each sum is made by fused multiply-adds in a fixed order, whatever the width of
//! vectors.

use crate::{
    instructions::macerator::{self, Simd},
    tile::{LANES, Lanes, fused, is_wide, lanes_at},
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
                for pair in weights.chunks_exact(2 * from.columns) {
                    let (one, other) = pair.split_at(from.columns);
                    product_of_pair::<S, WIDE_ROWS>(v, one, other, &mut m[block * LANES..], to.columns);
                    block += 2;
                }
            }
            for weights in weights[block * from.columns..].chunks_exact(from.columns) {
                if is_wide::<S>() {
                    product_of_block::<S, WIDE_ROWS>(v, weights, &mut m[block * LANES..], to.columns);
                } else {
                    product_of_block::<S, ROWS>(v, weights, &mut m[block * LANES..], to.columns);
                }
                block += 1;
            }
        }
    }
}

/// Returns `P` rows from `first` on; the last row stands in for those behind it.
#[inline(always)]
fn rows_of<const P: usize>(v: &[f32], width: usize, first: usize) -> [(usize, &[f32]); P] {
    let last = v.len() / width - 1;
    let mut rows = [(0, &v[..0]); P];
    for (p, to) in rows.iter_mut().enumerate() {
        let row = (first + p).min(last);
        *to = (row, &v[row * width..][..width]);
    }
    rows
}

/// Returns a block of 16 numbers of each row.
#[inline(always)]
fn blocks_of<'a, const P: usize>(rows: &[(usize, &'a [f32]); P], block: usize) -> [&'a [f32]; P] {
    let mut blocks = [rows[0].1; P];
    for p in 0..P {
        blocks[p] = &rows[p].1[block * LANES..][..LANES];
    }
    blocks
}

#[inline(always)]
fn product_of_block<S: Simd, const P: usize>(v: &[f32], weights: &[Lanes], to: &mut [f32], outputs: usize) {
    for first in (0..v.len() / weights.len()).step_by(P) {
        let rows = rows_of::<P>(v, weights.len(), first);
        let mut sums = [[0.0; LANES]; P];
        for (block, weights) in weights.as_chunks::<LANES>().0.iter().enumerate() {
            let x = blocks_of::<P>(&rows, block);
            for (k, &weights) in weights.iter().enumerate() {
                for p in 0..P {
                    let x = x[p][k];
                    for l in 0..LANES {
                        sums[p][l] = fused::<S>(x, weights[l], sums[p][l]);
                    }
                }
            }
        }
        for p in 0..P {
            to[rows[p].0 * outputs..][..LANES].copy_from_slice(&sums[p]);
        }
    }
}

/// Does [`product_of_block`] for two blocks at once, and reads the rows only once. The sums of both in one array
/// would not stay in registers.
#[inline(always)]
fn product_of_pair<S: Simd, const P: usize>(v: &[f32], one: &[Lanes], other: &[Lanes], to: &mut [f32], outputs: usize) {
    for first in (0..v.len() / one.len()).step_by(P) {
        let rows = rows_of::<P>(v, one.len(), first);
        let (mut sums0, mut sums1) = ([[0.0; LANES]; P], [[0.0; LANES]; P]);
        let weights = one.as_chunks::<LANES>().0.iter().zip(other.as_chunks::<LANES>().0);
        for (block, (one, other)) in weights.enumerate() {
            let x = blocks_of::<P>(&rows, block);
            for (k, (&weights0, &weights1)) in one.iter().zip(other).enumerate() {
                for p in 0..P {
                    let x = x[p][k];
                    for l in 0..LANES {
                        sums0[p][l] = fused::<S>(x, weights0[l], sums0[p][l]);
                    }
                    for l in 0..LANES {
                        sums1[p][l] = fused::<S>(x, weights1[l], sums1[p][l]);
                    }
                }
            }
        }
        for p in 0..P {
            let to = &mut to[rows[p].0 * outputs..];
            to[..LANES].copy_from_slice(&sums0[p]);
            to[LANES..2 * LANES].copy_from_slice(&sums1[p]);
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
                for pair in sums.chunks_exact_mut(2 * from.columns) {
                    let (one, other) = pair.split_at_mut(from.columns);
                    add_to_pair::<S, WIDE_ROWS>(v, &grad[block * LANES..], to.columns, one, other);
                    block += 2;
                }
            }
            for sums in sums[block * from.columns..].chunks_exact_mut(from.columns) {
                if is_wide::<S>() {
                    add_to_block::<S, WIDE_ROWS>(v, &grad[block * LANES..], to.columns, sums);
                } else {
                    add_to_block::<S, ROWS>(v, &grad[block * LANES..], to.columns, sums);
                }
                block += 1;
            }
        }
    }
}

#[inline(always)]
fn add_to_block<S: Simd, const P: usize>(v: &[f32], grad: &[f32], outputs: usize, sums: &mut [Lanes]) {
    let inputs = sums.len();
    for (tile, sums) in sums.chunks_exact_mut(P).enumerate() {
        let mut tile_sums = [[0.0; LANES]; P];
        tile_sums.copy_from_slice(sums);
        let mut at = tile * P;
        for row in 0..v.len() / inputs {
            let grad = *lanes_at(grad, row * outputs);
            for p in 0..P {
                let x = v[at + p];
                for l in 0..LANES {
                    tile_sums[p][l] = fused::<S>(x, grad[l], tile_sums[p][l]);
                }
            }
            at += inputs;
        }
        sums.copy_from_slice(&tile_sums);
    }
}

/// Does [`add_to_block`] for two blocks at once.
#[inline(always)]
fn add_to_pair<S: Simd, const P: usize>(
    v: &[f32],
    grad: &[f32],
    outputs: usize,
    one: &mut [Lanes],
    other: &mut [Lanes],
) {
    let inputs = one.len();
    for (tile, (one, other)) in one.chunks_exact_mut(P).zip(other.chunks_exact_mut(P)).enumerate() {
        let (mut sums0, mut sums1) = ([[0.0; LANES]; P], [[0.0; LANES]; P]);
        for p in 0..P {
            (sums0[p], sums1[p]) = (one[p], other[p]);
        }
        let mut at = tile * P;
        for row in 0..v.len() / inputs {
            let (grad0, grad1) = (*lanes_at(grad, row * outputs), *lanes_at(grad, row * outputs + LANES));
            for p in 0..P {
                let x = v[at + p];
                for l in 0..LANES {
                    sums0[p][l] = fused::<S>(x, grad0[l], sums0[p][l]);
                }
                for l in 0..LANES {
                    sums1[p][l] = fused::<S>(x, grad1[l], sums1[p][l]);
                }
            }
            at += inputs;
        }
        for p in 0..P {
            (one[p], other[p]) = (sums0[p], sums1[p]);
        }
    }
}

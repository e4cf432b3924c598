//! Products of many rows with a matrix.

use super::packed::Packed;
use super::share::share;
use crate::nn::Activation;
use crate::nn::cpu::fast_math::{tanh, vectorized};
use crate::nn::cpu::relu::relu;
use crate::nn::cpu::store::{Store, Write};
use crate::nn::cpu::tile::{LANES, Lanes, Window, correlate};

/// Rows that a thread takes at a time.
const ROWS: usize = 32;

/// x W + b, and the activation of that: `[n, columns]` for the rows `[n, rows of W]`, which begin every `stride` numbers of
/// `x`. Without `bias` sums start from 0.
pub(super) fn product(
    x: &[f32],
    (n, stride): (usize, usize),
    weights: &Packed,
    bias: &[f32],
    activation: Option<Activation>,
) -> Vec<f32> {
    let mut out = vec![0.0; n * weights.columns];
    product_into(&mut out, x, (n, stride), weights, bias, activation);
    out
}

/// [`product`] in memory that is there already; nothing of what it held is left.
pub(in crate::nn::cpu) fn product_into(
    out: &mut [f32],
    x: &[f32],
    (n, stride): (usize, usize),
    weights: &Packed,
    bias: &[f32],
    activation: Option<Activation>,
) {
    let Packed { rows, columns, .. } = *weights;
    let lanes = weights.lanes();
    let window = Window { count: 1, step: 0, len: rows };
    share(out, ROWS * columns, n * rows * columns, |piece, out| {
        let first = piece * ROWS;
        let starts: Vec<usize> = (first..first + out.len() / columns).map(|row| row * stride).collect();
        correlate(
            x,
            &starts,
            window,
            lanes,
            |block| block_of(bias, block),
            true,
            |row, block, sums| {
                let first = block * LANES;
                Write(&mut *out).store(row * columns + first, columns - first, sums);
            },
        );
        match activation {
            None => {}
            Some(Activation::Relu) => vectorized(|| out.iter_mut().for_each(|y| *y = relu(*y))),
            Some(Activation::Tanh) => vectorized(|| out.iter_mut().for_each(|y| *y = tanh(*y))),
        }
    });
}

/// The numbers of a block of 16; zeros beyond the last one.
fn block_of(numbers: &[f32], block: usize) -> Lanes {
    let mut lanes = [0.0; LANES];
    let rest = numbers.get(block * LANES..).unwrap_or(&[]);
    lanes.iter_mut().zip(rest).for_each(|(to, from)| *to = *from);
    lanes
}

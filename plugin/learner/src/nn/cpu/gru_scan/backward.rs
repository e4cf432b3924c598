//! The gradients of the inputs from those of the states.

use super::{Direction, Scan, Sizes, per_direction};
use crate::nn::cpu::fast_math::vectorized;
use crate::nn::cpu::kernels::{data, numbers, tensor};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use rayon::prelude::*;

/// Gradients of all that enters [`super::forward`], in its shapes.
pub(in crate::nn) struct ScanGrads<B: Backend> {
    pub(in crate::nn) input: FloatTensor<B>,
    pub(in crate::nn) weight: FloatTensor<B>,
    pub(in crate::nn) bias_ih: FloatTensor<B>,
    pub(in crate::nn) bias_hh: FloatTensor<B>,
    pub(in crate::nn) initial: FloatTensor<B>,
}

/// One direction's part of [`ScanGrads`].
struct DirectionGrads<'a> {
    /// `[T * B, 3 * hidden]`.
    input: &'a mut [f32],
    /// Of c, `[T * B, 3 * hidden]`.
    recurrent: &'a mut [f32],
    bias_ih: &'a mut [f32],
    bias_hh: &'a mut [f32],
    initial: &'a mut [f32],
}

/// The gradients for `output`, the gradient of the outputs. That of the initial state lacks its recurrent part, which
/// costs a product, unless `initial` asks for it.
pub(in crate::nn) fn backward<B: Backend>(
    output: FloatTensor<B>,
    scan: &Scan,
    weight: FloatTensor<B>,
    initial: bool,
) -> ScanGrads<B> {
    let device = output.device();
    let sizes = scan.sizes;
    let Sizes { steps, batch, hidden, directions } = sizes;
    let (rows, gates) = (steps * batch, sizes.gates());
    let output = data::<B>(output);
    let zeros = |per_direction: usize| vec![0.0; directions * per_direction];
    let (mut input, mut recurrent) = (zeros(rows * gates), zeros(rows * gates));
    let (mut bias_ih, mut bias_hh, mut first) = (zeros(gates), zeros(gates), zeros(sizes.block()));
    let wide = input.par_chunks_mut((rows * gates).max(1)).zip(recurrent.par_chunks_mut((rows * gates).max(1)));
    let biases = bias_ih.par_chunks_mut(gates).zip(bias_hh.par_chunks_mut(gates));
    let parts = wide.zip(biases.zip(first.par_chunks_mut(sizes.block().max(1))));
    let weights = per_direction::<B>(&weight, sizes);
    let work = parts.zip(weights.into_par_iter().zip(&scan.directions)).enumerate();
    work.for_each(|(d, (((input, recurrent), ((bias_ih, bias_hh), state)), (weight, run)))| {
        let grads = DirectionGrads { input, recurrent, bias_ih, bias_hh, initial: state };
        scan_backward::<B>(grads, numbers(&output), d, run, B::float_transpose(weight), initial, sizes, &device);
    });
    let before = scan.directions.iter().map(|run| {
        let from = if run.backwards { sizes.block() } else { 0 };
        &run.states[from..from + rows * hidden]
    });
    let before = tensor::<B>(before.collect::<Vec<_>>().concat(), [directions, rows, hidden], &device);
    let recurrent = tensor::<B>(recurrent, [directions, rows, gates], &device);
    ScanGrads {
        input: tensor::<B>(input, [directions, rows, gates], &device),
        weight: B::float_matmul(B::float_transpose(before), recurrent),
        bias_ih: tensor::<B>(bias_ih, [directions, gates], &device),
        bias_hh: tensor::<B>(bias_hh, [directions, gates], &device),
        initial: tensor::<B>(first, [directions, batch, hidden], &device),
    }
}

/// One direction of [`backward`]; `grads` start as zeros.
fn scan_backward<B: Backend>(
    mut grads: DirectionGrads<'_>,
    output: &[f32],
    direction: usize,
    run: &Direction,
    transposed: FloatTensor<B>,
    initial: bool,
    sizes: Sizes,
    device: &B::Device,
) {
    let gates = sizes.gates();
    // `initial` holds the gradient of the state between two steps until the first step is reached.
    let order: Vec<usize> = sizes.order(run.backwards).collect();
    for (k, &t) in order.iter().enumerate().rev() {
        vectorized(|| step_backward(&mut grads, t, output, direction, run, sizes));
        if k > 0 || initial {
            let c = grads.recurrent[t * sizes.batch * gates..(t + 1) * sizes.batch * gates].to_vec();
            let c = tensor::<B>(c, [sizes.batch, gates], device);
            let h = data::<B>(B::float_matmul(c, transposed.clone()));
            grads.initial.iter_mut().zip(numbers(&h)).for_each(|(grad, x)| *grad += x);
        }
    }
    for (row, c) in grads.input.chunks_exact(gates).zip(grads.recurrent.chunks_exact(gates)) {
        grads.bias_ih.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
        grads.bias_hh.iter_mut().zip(c).for_each(|(sum, x)| *sum += x);
    }
}

/// One step for all rows of the batch: from the gradient of the state after it to those of a, c and, but for the part
/// that goes through c, of the state before it.
#[inline(always)]
fn step_backward(
    grads: &mut DirectionGrads<'_>,
    t: usize,
    output: &[f32],
    direction: usize,
    run: &Direction,
    sizes: Sizes,
) {
    let (hidden, gates) = (sizes.hidden, sizes.gates());
    let (before, _) = run.around(t);
    for b in 0..sizes.batch {
        let row = t * sizes.batch + b;
        let here = row * hidden..(row + 1) * hidden;
        let from = (row * sizes.directions + direction) * hidden;
        let output = &output[from..from + hidden];
        let (r, z, n, c_n) = (&run.r[here.clone()], &run.z[here.clone()], &run.n[here.clone()], &run.c_n[here]);
        let from = (before * sizes.batch + b) * hidden;
        let h = &run.states[from..from + hidden];
        let state = &mut grads.initial[b * hidden..(b + 1) * hidden];
        let (d_r, rest) = grads.input[row * gates..(row + 1) * gates].split_at_mut(hidden);
        let (d_z, d_n) = rest.split_at_mut(hidden);
        let d_c = &mut grads.recurrent[row * gates + 2 * hidden..(row + 1) * gates];
        for j in 0..hidden {
            let d_state = state[j] + output[j];
            d_n[j] = d_state * (1.0 - z[j]) * (1.0 - n[j] * n[j]);
            d_z[j] = d_state * (h[j] - n[j]) * z[j] * (1.0 - z[j]);
            d_r[j] = d_n[j] * c_n[j] * r[j] * (1.0 - r[j]);
            d_c[j] = d_n[j] * r[j];
            state[j] = d_state * z[j];
        }
        let same = row * gates..row * gates + 2 * hidden;
        grads.recurrent[same.clone()].copy_from_slice(&grads.input[same]);
    }
}

//! The states from the inputs.

use super::{Direction, Scan, Sizes, per_direction};
use crate::nn::cpu::fast_math::{sigmoid, tanh, vectorized};
use crate::nn::cpu::kernels::{data, numbers, tensor};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use rayon::prelude::*;

/// The outputs `[T * B, directions * hidden]`; for the shapes of the inputs see [`crate::nn::cpu::kernels::GruInput`].
pub(in crate::nn) fn forward<B: Backend>(
    input: FloatTensor<B>,
    weight: FloatTensor<B>,
    bias_ih: FloatTensor<B>,
    bias_hh: FloatTensor<B>,
    initial: FloatTensor<B>,
) -> (FloatTensor<B>, Scan) {
    let device = input.device();
    let [directions, batch, hidden] = initial.shape().dims();
    let rows = input.shape()[1];
    let sizes = Sizes { steps: rows / batch.max(1), batch, hidden, directions };
    let [input, bias_ih, bias_hh, initial] = [input, bias_ih, bias_hh, initial].map(data::<B>);
    let weights = per_direction::<B>(&weight, sizes);
    let runs = weights.into_par_iter().enumerate().map(|(d, weight)| {
        let part = |all| of_direction(numbers(all), d, directions);
        scan::<B>(part(&input), weight, (part(&bias_ih), part(&bias_hh)), part(&initial), d == 1, sizes, &device)
    });
    let runs: Vec<Direction> = runs.collect();
    let output = joined(&runs, sizes);
    (tensor::<B>(output, [rows, directions * hidden], &device), Scan { sizes, directions: runs })
}

fn of_direction(all: &[f32], d: usize, directions: usize) -> &[f32] {
    let len = all.len() / directions;
    &all[d * len..(d + 1) * len]
}

fn scan<B: Backend>(
    input: &[f32],
    weight: FloatTensor<B>,
    bias: (&[f32], &[f32]),
    initial: &[f32],
    backwards: bool,
    sizes: Sizes,
    device: &B::Device,
) -> Direction {
    let (block, gates) = (sizes.block(), sizes.batch * sizes.gates());
    let zeros = || vec![0.0; sizes.steps * block];
    let states = vec![0.0; (sizes.steps + 1) * block];
    let mut run = Direction { backwards, r: zeros(), z: zeros(), n: zeros(), c_n: zeros(), states };
    let first = if backwards { sizes.steps * block } else { 0 };
    run.states[first..first + block].copy_from_slice(initial);
    for t in sizes.order(backwards) {
        let (before, _) = run.around(t);
        let h = &run.states[before * block..(before + 1) * block];
        // From the zero state the recurrent product is zero.
        let product = h.iter().any(|&x| x != 0.0).then(|| {
            let h = tensor::<B>(h.to_vec(), [sizes.batch, sizes.hidden], device);
            data::<B>(B::float_matmul(h, weight.clone()))
        });
        let product = product.as_ref().map(numbers);
        let input = &input[t * gates..(t + 1) * gates];
        vectorized(|| step(&mut run, t, input, product, bias, sizes));
    }
    run
}

/// One step for all rows of the batch; `product` is h W_hh.
#[inline(always)]
fn step(
    run: &mut Direction,
    t: usize,
    input: &[f32],
    product: Option<&[f32]>,
    (bias_ih, bias_hh): (&[f32], &[f32]),
    sizes: Sizes,
) {
    let (hidden, gates) = (sizes.hidden, sizes.gates());
    let (before, after) = run.around(t);
    let zeros = vec![0.0; gates];
    let mut state = vec![0.0; hidden];
    for b in 0..sizes.batch {
        let at = |block: usize| (block * sizes.batch + b) * hidden..(block * sizes.batch + b + 1) * hidden;
        let a = &input[b * gates..(b + 1) * gates];
        let c = product.map_or(&zeros[..], |all| &all[b * gates..(b + 1) * gates]);
        let gate = |k: usize| {
            let part = k * hidden..(k + 1) * hidden;
            let sums = a[part.clone()].iter().zip(&c[part.clone()]);
            sums.zip(bias_ih[part.clone()].iter().zip(&bias_hh[part]))
        };
        for (r, ((a, c), (bi, bh))) in run.r[at(t)].iter_mut().zip(gate(0)) {
            *r = sigmoid((a + bi) + (c + bh));
        }
        for (z, ((a, c), (bi, bh))) in run.z[at(t)].iter_mut().zip(gate(1)) {
            *z = sigmoid((a + bi) + (c + bh));
        }
        let outputs = run.c_n[at(t)].iter_mut().zip(&mut run.n[at(t)]).zip(&run.r[at(t)]);
        for (((c_n, n), r), ((a, c), (bi, bh))) in outputs.zip(gate(2)) {
            *c_n = c + bh;
            *n = tanh((a + bi) + r * *c_n);
        }
        let inputs = run.n[at(t)].iter().zip(&run.z[at(t)]).zip(&run.states[at(before)]);
        for (new, ((n, z), h)) in state.iter_mut().zip(inputs) {
            *new = n + z * (h - n);
        }
        run.states[at(after)].copy_from_slice(&state);
    }
}

/// The states after each step of all directions, `[T * B, directions * hidden]`.
fn joined(runs: &[Direction], sizes: Sizes) -> Vec<f32> {
    let mut out = Vec::with_capacity(runs.len() * sizes.steps * sizes.block());
    for t in 0..sizes.steps {
        for b in 0..sizes.batch {
            for run in runs {
                let at = (run.around(t).1 * sizes.batch + b) * sizes.hidden;
                out.extend_from_slice(&run.states[at..at + sizes.hidden]);
            }
        }
    }
    out
}

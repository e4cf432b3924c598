//! The recurrent part of a GRU layer over all its steps, forward and backward, in plain loops.
//!
//! Against a graph of tensor operations this saves the copies of gates and states, and it takes the gradient of W_hh
//! as one product over all steps. The two directions are computed at the same time; within a direction nothing
//! depends on the number of threads.
//!
//! With a = x W_i + b_i and c = h W_h + b_h for each gate (see [`super::Gru`]): r = σ(a_r + c_r), z = σ(a_z + c_z),
//! n = tanh(a_n + r c_n), h' = n + z (h - n).

use super::fast_math::{sigmoid, tanh, vectorized};
use super::kernels::{data, numbers, tensor};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::Slice;
use rayon::prelude::*;

/// Sizes of a layer's sequence.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    steps: usize,
    batch: usize,
    hidden: usize,
    directions: usize,
}

/// What a forward pass leaves for the backward pass.
#[derive(Debug)]
pub(super) struct Scan {
    sizes: Sizes,
    directions: Vec<Direction>,
}

/// One direction's numbers, `[T * B, hidden]` each, time-major.
#[derive(Debug)]
struct Direction {
    backwards: bool,
    r: Vec<f32>,
    z: Vec<f32>,
    n: Vec<f32>,
    c_n: Vec<f32>,
    /// `[(T + 1) * B, hidden]`: the state before the first step and after each, in order of time.
    states: Vec<f32>,
}

/// Gradients of all that enters [`forward`], in its shapes.
pub(super) struct ScanGrads<B: Backend> {
    pub(super) input: FloatTensor<B>,
    pub(super) weight: FloatTensor<B>,
    pub(super) bias_ih: FloatTensor<B>,
    pub(super) bias_hh: FloatTensor<B>,
    pub(super) initial: FloatTensor<B>,
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

impl Sizes {
    fn gates(self) -> usize {
        3 * self.hidden
    }

    /// Numbers in one step of states.
    fn block(self) -> usize {
        self.batch * self.hidden
    }

    /// The time steps in the order in which a direction reads them.
    fn order(self, backwards: bool) -> impl Iterator<Item = usize> {
        (0..self.steps).map(move |s| if backwards { self.steps - 1 - s } else { s })
    }
}

impl Direction {
    /// Where in `states` the state before and after the step at time `t` begin, in blocks.
    fn around(&self, t: usize) -> (usize, usize) {
        if self.backwards { (t + 1, t) } else { (t, t + 1) }
    }
}

/// The outputs `[T * B, directions * hidden]`; for the shapes of the inputs see [`super::kernels::Kernels`].
pub(super) fn forward<B: Backend>(
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

/// The gradients for `output`, the gradient of the outputs. That of the initial state lacks its recurrent part, which
/// costs a product, unless `initial` asks for it.
pub(super) fn backward<B: Backend>(
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

/// W_hh of each direction, `[hidden, 3 * hidden]`.
fn per_direction<B: Backend>(weight: &FloatTensor<B>, sizes: Sizes) -> Vec<FloatTensor<B>> {
    let (hidden, gates) = (sizes.hidden, sizes.gates());
    (0..sizes.directions)
        .map(|d| {
            let slices = [d..d + 1, 0..hidden, 0..gates].map(Slice::from);
            B::float_reshape(B::float_slice(weight.clone(), &slices), [hidden, gates].into())
        })
        .collect()
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

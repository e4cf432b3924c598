//! A GRU layer over all its steps, forward and backward, in plain loops.
//!
//! Compared with a graph of tensor operations this saves the copies of gates and states. The gradients of the weights
//! are one product over all steps. The two directions are computed at the same time; within a direction nothing
//! depends on the number of threads.
//!
//! With a = x W_i + b_i and c = h W_h + b_h for each gate (see `Gru` in `playbot_learner`): r = σ(a_r + c_r), z =
//! σ(a_z + c_z), n = tanh(a_n + r c_n), h' = n + z (h - n).

use crate::{
    dense::{LayerSums, Matrix, Packed, SumGrads, param_grads, product_into},
    elementwise::{sigmoid, tanh, vectorized},
    kept_memory::{KeptMemory, share_each},
};

// Sizes, inputs and intermediate results of a recurrent layer's sequence.

/// Sizes of a layer's sequence.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    pub steps: usize,
    pub batch: usize,
    pub inputs: usize,
    pub hidden: usize,
    pub directions: usize,
}

/// The inputs of a layer, in host memory: see [`crate::host_ops::GruInput`].
#[derive(Clone, Copy, Debug)]
pub struct ScanInput<'a> {
    pub x: &'a [f32],
    pub weight_ih: &'a [f32],
    pub weight_hh: &'a [f32],
}

/// The data that a forward pass keeps for the backward pass.
#[derive(Debug)]
pub struct ScanRecord {
    pub sizes: Sizes,
    directions: Vec<Direction>,
}

/// One direction's numbers, `[T * B, hidden]` each, time-major.
#[derive(Debug)]
struct Direction {
    backwards: bool,
    r: KeptMemory,
    z: KeptMemory,
    n: KeptMemory,
    c_n: KeptMemory,
    /// `[(T + 1) * B, hidden]`: the state before the first step and after each, in order of time.
    states: KeptMemory,
}

impl Sizes {
    fn rows(self) -> usize {
        self.steps * self.batch
    }

    fn gates(self) -> usize {
        3 * self.hidden
    }

    /// Returns the numbers in one step of states.
    fn block(self) -> usize {
        self.batch * self.hidden
    }

    /// Returns the time steps in the order in which a direction reads them.
    fn order(self, backwards: bool) -> impl Iterator<Item = usize> {
        (0..self.steps).map(move |s| if backwards { self.steps - 1 - s } else { s })
    }
}

impl Direction {
    /// Returns the positions in `states` of the state before and after the step at time `t`, in blocks.
    fn around(&self, t: usize) -> (usize, usize) {
        if self.backwards { (t + 1, t) } else { (t, t + 1) }
    }
}

/// Returns a direction's part of data that all directions share.
fn of_direction(all: &[f32], d: usize, directions: usize) -> &[f32] {
    let len = all.len() / directions;
    &all[d * len..(d + 1) * len]
}

/// Returns the result of each direction, which threads share.
fn each_direction<T: Send>(sizes: Sizes, of_direction: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let mut found: Vec<Option<T>> = (0..sizes.directions).map(|_| None).collect();
    let products = sizes.directions * sizes.rows() * sizes.gates() * (sizes.inputs + sizes.hidden);
    share_each(&mut found, products, |d, found| *found = Some(of_direction(d)));
    found.into_iter().flatten().collect()
}

// The forward pass: the states from the inputs.

/// Returns the outputs `[T * B, directions * hidden]`, with the biases of input and state, `[directions, 3 * hidden]`
/// each, and the states before the first step, `[directions, B, hidden]`.
pub fn forward(
    input: ScanInput<'_>,
    (bias_ih, bias_hh): (&[f32], &[f32]),
    initial: &[f32],
    sizes: Sizes,
) -> (Vec<f32>, ScanRecord) {
    let runs = each_direction(sizes, |d| {
        let part = |all| of_direction(all, d, sizes.directions);
        let packed = |numbers, rows| Packed::new(Matrix { numbers, rows, columns: sizes.gates(), is_turned: false });
        let weights = packed(part(input.weight_ih), sizes.inputs);
        let mut sums = KeptMemory::take(sizes.rows() * sizes.gates());
        product_into(&mut sums, input.x, sizes.inputs, &weights, part(bias_ih));
        let weights = packed(part(input.weight_hh), sizes.hidden);
        scan(&sums, &weights, part(bias_hh), part(initial), d == 1, sizes)
    });
    (joined(&runs, sizes), ScanRecord { sizes, directions: runs })
}

/// Scans one direction, for its sums x W_ih + b_ih.
fn scan(sums: &[f32], weights: &Packed, bias: &[f32], initial: &[f32], backwards: bool, sizes: Sizes) -> Direction {
    let (block, gates) = (sizes.block(), sizes.batch * sizes.gates());
    let numbers = || KeptMemory::take(sizes.steps * block);
    let states = KeptMemory::take((sizes.steps + 1) * block);
    let mut run = Direction { backwards, r: numbers(), z: numbers(), n: numbers(), c_n: numbers(), states };
    let mut recurrent = KeptMemory::take(gates);
    let first = if backwards { sizes.steps * block } else { 0 };
    run.states[first..first + block].copy_from_slice(initial);
    for t in sizes.order(backwards) {
        let (before, _) = run.around(t);
        let h = &run.states[before * block..(before + 1) * block];
        product_into(&mut recurrent, h, sizes.hidden, weights, bias);
        let sums = &sums[t * gates..(t + 1) * gates];
        vectorized(|| step(&mut run, t, sums, &recurrent, sizes));
    }
    run
}

/// Does one step for all rows of the batch; `a` is x W_ih + b_ih, `c` is h W_hh + b_hh.
#[inline(always)]
fn step(run: &mut Direction, t: usize, a: &[f32], c: &[f32], sizes: Sizes) {
    let (hidden, gates) = (sizes.hidden, sizes.gates());
    let (before, after) = run.around(t);
    let mut state = vec![0.0; hidden];
    for b in 0..sizes.batch {
        let at = |block: usize| (block * sizes.batch + b) * hidden..(block * sizes.batch + b + 1) * hidden;
        let (a, c) = (&a[b * gates..(b + 1) * gates], &c[b * gates..(b + 1) * gates]);
        let gate = |k: usize| {
            let part = k * hidden..(k + 1) * hidden;
            a[part.clone()].iter().zip(&c[part])
        };
        for (r, (a, c)) in run.r[at(t)].iter_mut().zip(gate(0)) {
            *r = sigmoid(a + c);
        }
        for (z, (a, c)) in run.z[at(t)].iter_mut().zip(gate(1)) {
            *z = sigmoid(a + c);
        }
        run.c_n[at(t)].copy_from_slice(&c[2 * hidden..]);
        for ((n, r), (a, c)) in run.n[at(t)].iter_mut().zip(&run.r[at(t)]).zip(gate(2)) {
            *n = tanh(a + r * c);
        }
        let inputs = run.n[at(t)].iter().zip(&run.z[at(t)]).zip(&run.states[at(before)]);
        for (new, ((n, z), h)) in state.iter_mut().zip(inputs) {
            *new = n + z * (h - n);
        }
        run.states[at(after)].copy_from_slice(&state);
    }
}

/// Returns the states after each step of all directions, `[T * B, directions * hidden]`.
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

// The backward pass: the gradients of the inputs from those of the states.

/// Gradients of all inputs of [`self`], in their shapes.
pub struct ScanGrads {
    pub x: Vec<f32>,
    pub weight_ih: Vec<f32>,
    pub weight_hh: Vec<f32>,
    pub bias_ih: Vec<f32>,
    pub bias_hh: Vec<f32>,
    pub initial: Vec<f32>,
}

/// The parts of [`ScanGrads`] that are requested and cost a product of their own.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    pub x: bool,
    /// False if the gradient of the initial states may lack its recurrent part.
    pub initial: bool,
}

/// Returns the gradients for `output`, the gradient of the outputs.
pub fn backward(output: &[f32], input: ScanInput<'_>, scan: &ScanRecord, wanted: Wanted) -> ScanGrads {
    let sizes = scan.sizes;
    let parts = each_direction(sizes, |d| {
        let part = |all| of_direction(all, d, sizes.directions);
        let weights = (part(input.weight_ih), part(input.weight_hh));
        of_one_direction(output, input.x, weights, d, &scan.directions[d], wanted, sizes)
    });
    let mut all = ScanGrads {
        x: Vec::new(),
        weight_ih: Vec::new(),
        weight_hh: Vec::new(),
        bias_ih: Vec::new(),
        bias_hh: Vec::new(),
        initial: Vec::new(),
    };
    for part in parts {
        if all.x.is_empty() {
            all.x = part.x;
        } else {
            vectorized(|| all.x.iter_mut().zip(&part.x).for_each(|(sum, x)| *sum += x));
        }
        all.weight_ih.extend(part.weight_ih);
        all.weight_hh.extend(part.weight_hh);
        all.bias_ih.extend(part.bias_ih);
        all.bias_hh.extend(part.bias_hh);
        all.initial.extend(part.initial);
    }
    all
}

/// Returns a direction's part of [`backward`], with its weights of input and state.
fn of_one_direction(
    output: &[f32],
    x: &[f32],
    (weight_ih, weight_hh): (&[f32], &[f32]),
    direction: usize,
    run: &Direction,
    wanted: Wanted,
    sizes: Sizes,
) -> ScanGrads {
    let Sizes { batch, inputs, hidden, .. } = sizes;
    let (rows, gates) = (sizes.rows(), sizes.gates());
    let turned = |numbers, columns| Packed::new(Matrix { numbers, rows: gates, columns, is_turned: true });
    let to_state = turned(weight_hh, hidden);
    let mut sums = GateGrads { input: SumGrads::unwritten(rows, gates), recurrent: SumGrads::unwritten(rows, gates) };
    let stride = sums.input.stride();
    // Of the state between two steps, until the first step is reached.
    let mut state = vec![0.0; sizes.block()];
    let mut h = KeptMemory::take(sizes.block());
    let order: Vec<usize> = sizes.order(run.backwards).collect();
    for (k, &t) in order.iter().enumerate().rev() {
        vectorized(|| step_backward(&mut sums, &mut state, t, output, direction, run, sizes));
        if k > 0 || wanted.initial {
            let c = &sums.recurrent.values()[t * batch * stride..];
            product_into(&mut h, c, stride, &to_state, &[]);
            vectorized(|| state.iter_mut().zip(h.iter()).for_each(|(grad, x)| *grad += x));
        }
    }
    let before = if run.backwards { sizes.block() } else { 0 };
    let states = &run.states[before..before + rows * hidden];
    let layers = [(x, inputs, &sums.input), (states, hidden, &sums.recurrent)];
    let layers = layers.map(|(x, inputs, sums)| LayerSums { x, inputs, sums });
    let Ok([ih, hh]) = <[_; 2]>::try_from(param_grads(&layers)) else { unreachable!("one for each") };
    let mut x = Vec::new();
    if wanted.x {
        x.resize(rows * inputs, 0.0);
        product_into(&mut x, sums.input.values(), stride, &turned(weight_ih, inputs), &[]);
    }
    ScanGrads { x, weight_ih: ih.weights, weight_hh: hh.weights, bias_ih: ih.bias, bias_hh: hh.bias, initial: state }
}

/// The gradients of a direction's sums, for T * B rows.
struct GateGrads {
    /// Gradients of a.
    input: SumGrads,
    /// Gradients of c.
    recurrent: SumGrads,
}

/// Does one step for all rows of the batch. It goes from the gradient of the state after it to those of a, c and the
/// state before it, except for the part that goes through c.
#[inline(always)]
fn step_backward(
    grads: &mut GateGrads,
    state: &mut [f32],
    t: usize,
    output: &[f32],
    direction: usize,
    run: &Direction,
    sizes: Sizes,
) {
    let (hidden, gates) = (sizes.hidden, sizes.gates());
    let (before, _) = run.around(t);
    let stride = grads.input.stride();
    let (of_input, of_recurrent) = (grads.input.values_mut(), grads.recurrent.values_mut());
    for b in 0..sizes.batch {
        let row = t * sizes.batch + b;
        let here = row * hidden..(row + 1) * hidden;
        let from = (row * sizes.directions + direction) * hidden;
        let output = &output[from..from + hidden];
        let (r, z, n, c_n) = (&run.r[here.clone()], &run.z[here.clone()], &run.n[here.clone()], &run.c_n[here]);
        let from = (before * sizes.batch + b) * hidden;
        let h = &run.states[from..from + hidden];
        let state = &mut state[b * hidden..(b + 1) * hidden];
        let (d_r, rest) = of_input[row * stride..][..gates].split_at_mut(hidden);
        let (d_z, d_n) = rest.split_at_mut(hidden);
        let d_c = &mut of_recurrent[row * stride..][2 * hidden..gates];
        for j in 0..hidden {
            let d_state = state[j] + output[j];
            d_n[j] = d_state * (1.0 - z[j]) * (1.0 - n[j] * n[j]);
            d_z[j] = d_state * (h[j] - n[j]) * z[j] * (1.0 - z[j]);
            d_r[j] = d_n[j] * c_n[j] * r[j] * (1.0 - r[j]);
            d_c[j] = d_n[j] * r[j];
            state[j] = d_state * z[j];
        }
        let same = row * stride..row * stride + 2 * hidden;
        of_recurrent[same.clone()].copy_from_slice(&of_input[same]);
    }
}

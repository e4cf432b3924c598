//! The forward pass: the states from the inputs.

use super::scan::of_direction;
use super::{Direction, Scan, ScanInput, Sizes};
use crate::nn::cpu::dense::{Matrix, Packed, product_into};
use crate::nn::cpu::fast_math::{sigmoid, tanh, vectorized};
use crate::nn::cpu::kept_memory::KeptMemory;
use rayon::prelude::*;

/// Returns the outputs `[T * B, directions * hidden]`, with the biases of input and state, `[directions, 3 * hidden]`
/// each, and the states before the first step, `[directions, B, hidden]`.
pub(in crate::nn) fn forward(
    input: ScanInput<'_>,
    (bias_ih, bias_hh): (&[f32], &[f32]),
    initial: &[f32],
    sizes: Sizes,
) -> (Vec<f32>, Scan) {
    let runs = (0..sizes.directions).into_par_iter().map(|d| {
        let part = |all| of_direction(all, d, sizes.directions);
        let packed = |numbers, rows| Packed::new(Matrix { numbers, rows, columns: sizes.gates(), is_turned: false });
        let weights = packed(part(input.weight_ih), sizes.inputs);
        let mut sums = KeptMemory::take(sizes.rows() * sizes.gates());
        product_into(&mut sums, input.x, sizes.inputs, &weights, part(bias_ih));
        let weights = packed(part(input.weight_hh), sizes.hidden);
        scan(&sums, &weights, part(bias_hh), part(initial), d == 1, sizes)
    });
    let runs: Vec<Direction> = runs.collect();
    (joined(&runs, sizes), Scan { sizes, directions: runs })
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

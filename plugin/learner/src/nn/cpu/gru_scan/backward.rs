//! The gradients of the inputs from those of the states.

use super::scan::of_direction;
use super::{Direction, Scan, ScanInput, Sizes};
use crate::nn::cpu::dense::{Packed, SumGrads, product_into};
use crate::nn::cpu::fast_math::vectorized;
use crate::nn::cpu::kept_memory::KeptMemory;
use rayon::prelude::*;

/// Gradients of all that enters [`super::forward`], in its shapes.
pub(in crate::nn) struct ScanGrads {
    pub(in crate::nn) x: Vec<f32>,
    pub(in crate::nn) weight_ih: Vec<f32>,
    pub(in crate::nn) weight_hh: Vec<f32>,
    pub(in crate::nn) bias_ih: Vec<f32>,
    pub(in crate::nn) bias_hh: Vec<f32>,
    pub(in crate::nn) initial: Vec<f32>,
}

/// What of [`ScanGrads`] costs a product of its own and is asked for.
#[derive(Clone, Copy, Debug)]
pub(in crate::nn) struct Wanted {
    pub(in crate::nn) x: bool,
    /// Else that of the initial states lacks its recurrent part.
    pub(in crate::nn) initial: bool,
}

/// The gradients for `output`, that of the outputs.
pub(in crate::nn) fn backward(output: &[f32], input: ScanInput<'_>, scan: &Scan, wanted: Wanted) -> ScanGrads {
    let sizes = scan.sizes;
    let parts = scan.directions.par_iter().enumerate().map(|(d, run)| {
        let part = |all| of_direction(all, d, sizes.directions);
        let weights = (part(input.weight_ih), part(input.weight_hh));
        of_one_direction(output, input.x, weights, d, run, wanted, sizes)
    });
    let mut all = ScanGrads {
        x: Vec::new(),
        weight_ih: Vec::new(),
        weight_hh: Vec::new(),
        bias_ih: Vec::new(),
        bias_hh: Vec::new(),
        initial: Vec::new(),
    };
    for part in parts.collect::<Vec<ScanGrads>>() {
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

/// A direction's part of [`backward`], with its weights of input and state.
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
    let turned = Packed::transposed(weight_hh, gates, hidden);
    let mut sums = SumGradsOfRows { input: KeptMemory::take(rows * gates), recurrent: KeptMemory::take(rows * gates) };
    // Of the state between two steps, until the first step is reached.
    let mut state = vec![0.0; sizes.block()];
    let mut h = KeptMemory::take(sizes.block());
    let order: Vec<usize> = sizes.order(run.backwards).collect();
    for (k, &t) in order.iter().enumerate().rev() {
        vectorized(|| step_backward(&mut sums, &mut state, t, output, direction, run, sizes));
        if k > 0 || wanted.initial {
            let c = &sums.recurrent[t * batch * gates..(t + 1) * batch * gates];
            product_into(&mut h, c, (batch, gates), &turned, &[], None);
            vectorized(|| state.iter_mut().zip(h.iter()).for_each(|(grad, x)| *grad += x));
        }
    }
    let before = if run.backwards { sizes.block() } else { 0 };
    let of_rows = |grads: &[f32]| SumGrads::new(grads, grads, gates, None);
    let of_input = of_rows(&sums.input);
    let (weight_hh, bias_hh) = of_rows(&sums.recurrent).params(&run.states[before..before + rows * hidden], hidden);
    let (found_ih, bias_ih) = of_input.params(x, inputs);
    let x = if wanted.x { of_input.input(weight_ih) } else { Vec::new() };
    ScanGrads { x, weight_ih: found_ih, weight_hh, bias_ih, bias_hh, initial: state }
}

/// The gradients of a direction's sums, `[T * B, 3 * hidden]` each.
struct SumGradsOfRows {
    /// Of a.
    input: KeptMemory,
    /// Of c.
    recurrent: KeptMemory,
}

/// One step for all rows of the batch: from the gradient of the state after it to those of a, c and, but for the part
/// that goes through c, of the state before it.
#[inline(always)]
fn step_backward(
    grads: &mut SumGradsOfRows,
    state: &mut [f32],
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
        let state = &mut state[b * hidden..(b + 1) * hidden];
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

//! The backward pass: the gradients of the inputs from those of the states.

use super::scan::of_direction;
use super::{Direction, Scan, ScanInput, Sizes};
use crate::nn::cpu::dense::{LayerSums, Matrix, Packed, SumGrads, param_grads, product_into};
use crate::nn::cpu::fast_math::vectorized;
use crate::nn::cpu::kept_memory::KeptMemory;
use rayon::prelude::*;

/// Gradients of all inputs of [`super::forward`], in their shapes.
pub(in crate::nn) struct ScanGrads {
    pub(in crate::nn) x: Vec<f32>,
    pub(in crate::nn) weight_ih: Vec<f32>,
    pub(in crate::nn) weight_hh: Vec<f32>,
    pub(in crate::nn) bias_ih: Vec<f32>,
    pub(in crate::nn) bias_hh: Vec<f32>,
    pub(in crate::nn) initial: Vec<f32>,
}

/// The parts of [`ScanGrads`] that are requested and cost a product of their own.
#[derive(Clone, Copy, Debug)]
pub(in crate::nn) struct Wanted {
    pub(in crate::nn) x: bool,
    /// False if the gradient of the initial states may lack its recurrent part.
    pub(in crate::nn) initial: bool,
}

/// Returns the gradients for `output`, the gradient of the outputs.
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

/// Does one step for all rows of the batch: from the gradient of the state after it to those of a, c and the state
/// before it, except for the part that goes through c.
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

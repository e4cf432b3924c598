//! The backward pass: from the gradient of the features to those of the parameters.

use super::forward::SavedActivations;
use super::group::{self, Group};
use super::layer::{Layer, Weights};
use super::plan::{Plan, Step};
use super::pool;
use super::workspace::Workspace;
use crate::nn::cpu::fast_math::vectorized;
use crate::nn::cpu::kept_memory::KeptMemory;
use crate::nn::cpu::relu::relu_backward;
use crate::nn::cpu::store::{AddWhere, Write};
use crate::nn::cpu::tile::{LANES, Lanes};
use rayon::prelude::*;

/// Number of parts into which a batch is split, each with its own sums of gradients.
const PARTS: usize = 32;
/// Smallest number of images of a part.
const IMAGES: usize = 8;

/// Returns the gradients of all parameters, layer by layer, for the gradient `[n, Plan::features]` of the features.
///
/// The parts depend on the batch alone and are added in order, so the sums are the same on any number of threads.
pub(super) fn gradients(plan: &Plan, weights: &[Weights], saved: &SavedActivations, grad: &[f32]) -> Vec<f32> {
    let n = grad.len() / plan.features();
    let part = n.div_ceil(PARTS).max(IMAGES);
    let group = Group::new(plan);
    let at_once = if group.is_some() { group::IMAGES } else { 1 };
    let (kept_len, lean_len) = (plan.kept.len, plan.lean.len);
    let memory = || (Workspace::new(plan), KeptMemory::zeros(at_once * lean_len));
    let parts = (0..n.div_ceil(part)).into_par_iter().map_init(memory, |(work, grads), i| {
        let mut memory = KeptMemory::zeros(plan.layers.iter().map(Layer::sums).sum::<usize>() * LANES);
        let mut sums: Vec<&mut [Lanes]> = by_layer(plan, memory.as_chunks_mut().0, Layer::sums);
        let end = n.min((i + 1) * part);
        for first in (i * part..end).step_by(at_once) {
            let images = first..end.min(first + at_once);
            for (image, grads) in images.clone().zip(grads.chunks_exact_mut(lean_len)) {
                let grad = &grad[image * plan.features()..][..plan.features()];
                let values = &saved.values[image * kept_len..][..kept_len];
                let marks = &saved.marks[image * plan.marks..][..plan.marks];
                let last = plan.lean.write(plan.last, grads);
                plan.slots[plan.last].read(grad, last);
                mask(last, plan.kept.read(plan.last, values));
                backward(plan, weights, values, marks, work, grads, &mut sums, group.is_none());
            }
            if let Some(group) = &group {
                let values = &saved.values[first * kept_len..][..images.len() * kept_len];
                group.add_gradients(plan, images.len(), values, grads, &mut sums);
            }
        }
        memory
    });
    let mut parts: Vec<KeptMemory> = parts.collect();
    let mut params = KeptMemory::take(plan.layers.iter().map(Layer::params).sum()).into_vec();
    let Some((total, others)) = parts.split_first_mut() else { return vec![0.0; params.len()] };
    let mut first = 0;
    let totals = by_layer(plan, total.as_chunks_mut::<LANES>().0, Layer::sums).into_iter().map(|total| {
        first += total.len();
        (first - total.len(), total)
    });
    let of_layers: Vec<_> = totals.zip(by_layer(plan, &mut params, Layer::params)).collect();
    plan.layers.par_iter().zip(of_layers).for_each(|(layer, ((first, total), params))| {
        for part in &*others {
            let sums = &part.as_chunks::<LANES>().0[first..][..total.len()];
            let pairs = total.as_flattened_mut().iter_mut().zip(sums.as_flattened());
            vectorized(|| pairs.for_each(|(sum, x)| *sum += x));
        }
        layer.gradients(total, params);
    });
    params
}

/// Splits `all` into pieces, one for each layer, of that layer's length.
fn by_layer<'a, T>(plan: &Plan, mut all: &'a mut [T], count: fn(&Layer) -> usize) -> Vec<&'a mut [T]> {
    let of_layer = |layer| all.split_off_mut(..count(layer)).expect("there is some for each layer");
    plan.layers.iter().map(of_layer).collect()
}

/// Converts the gradients of a ReLU's output to those of its input.
fn mask(grads: &mut [f32], values: &[f32]) {
    vectorized(|| grads.iter_mut().zip(values).for_each(|(grad, &value)| *grad = relu_backward(value, *grad)));
}

/// Does all steps for one image, from the last; the gradient of the image itself is not needed. `grads` is laid out
/// as [`Plan::lean`], with zeros in the borders. Weights of a convolution before a ReLU get no gradients if a
/// [`Group`] computes them.
fn backward(
    plan: &Plan,
    weights: &[Weights],
    values: &[f32],
    marks: &[u8],
    Workspace { wides, points }: &mut Workspace,
    grads: &mut [f32],
    sums: &mut [&mut [Lanes]],
    alone: bool,
) {
    let (kept, lean, layers) = (&plan.kept, &plan.lean, &plan.layers);
    for (number, step) in plan.steps.iter().enumerate().rev() {
        match *step {
            Step::Relu { layer, input, output } => {
                mask(lean.write(output, grads), kept.read(output, values));
                let (to, grad) = lean.two(input, output, grads);
                if alone {
                    layers[layer].add_gradients(kept.read(input, values), grad, points, sums[layer]);
                }
                if number > 0 {
                    layers[layer].backward(grad, &weights[layer], points, to);
                }
            }
            Step::Pool { layer, input, output, wide, marks: from } => {
                let (to, grad) = lean.two(input, output, grads);
                let (buffer, grid, of) = (&mut wides[wide][..], plan.wides[wide], plan.slots[output]);
                pool::backward(grad, of, &marks[from..][..of.numbers()], buffer, grid);
                layers[layer].add_gradients(kept.read(input, values), buffer, points, sums[layer]);
                if number > 0 {
                    layers[layer].backward(buffer, &weights[layer], points, to);
                }
            }
            Step::Residual { layers: [layer0, layer1], x, relu, inner } => {
                let (relu, hidden) = (kept.read(relu, values), kept.read(inner, values));
                let (x, inside) = lean.two(x, inner, grads);
                layers[layer1].add_gradients(hidden, x, points, sums[layer1]);
                layers[layer1].backward_same(x, &weights[layer1], points, Write(inside));
                mask(inside, hidden);
                layers[layer0].add_gradients(relu, inside, points, sums[layer0]);
                layers[layer0].backward_same(inside, &weights[layer0], points, AddWhere(x, relu));
            }
        }
    }
}

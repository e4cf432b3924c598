//! From the gradient of the features to those of the parameters.

use super::forward::SavedActivations;
use super::group::{self, Group};
use super::layer::{Layer, Weights};
use super::plan::{Plan, Step};
use super::pool;
use super::workspace::Workspace;
use crate::nn::cpu::fast_math::vectorized;
use crate::nn::cpu::relu::relu_backward;
use crate::nn::cpu::store::{AddWhere, Write};
use crate::nn::cpu::tile::{LANES, Lanes};
use rayon::prelude::*;

/// Into how many parts a batch is split, each with its own sums of gradients.
const PARTS: usize = 32;
/// Images of a part, at least.
const IMAGES: usize = 8;

/// The gradients of all parameters, layer by layer, for the gradient `[n, Plan::features]` of the features.
///
/// The parts depend on the batch alone and are added in order: the sums are the same on any number of threads.
pub(super) fn gradients(plan: &Plan, weights: &[Weights], saved: &SavedActivations, grad: &[f32]) -> Vec<f32> {
    let n = grad.len() / plan.features();
    let part = n.div_ceil(PARTS).max(IMAGES);
    let group = Group::new(plan);
    let at_once = if group.is_some() { group::IMAGES } else { 1 };
    let (kept_len, lean_len) = (plan.kept.len, plan.lean.len);
    let memory = || (Workspace::new(plan), vec![0.0; at_once * lean_len]);
    let parts = (0..n.div_ceil(part)).into_par_iter().map_init(memory, |(work, grads), i| {
        let mut sums = zeros(plan);
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
        sums
    });
    let parts: Vec<Vec<Vec<Lanes>>> = parts.collect();
    let mut params = vec![0.0; plan.layers.iter().map(Layer::params).sum()];
    let mut rest = &mut params[..];
    let mut of_layers = Vec::new();
    for layer in &plan.layers {
        let (of_layer, others) = rest.split_at_mut(layer.params());
        of_layers.push(of_layer);
        rest = others;
    }
    plan.layers.par_iter().zip(of_layers).enumerate().for_each(|(number, (layer, params))| {
        let mut total = vec![[0.0; LANES]; layer.sums()];
        for part in &parts {
            let pairs = total.as_flattened_mut().iter_mut().zip(part[number].as_flattened());
            vectorized(|| pairs.for_each(|(sum, x)| *sum += x));
        }
        layer.gradients(&total, params);
    });
    params
}

/// For each layer, where its gradients are summed.
fn zeros(plan: &Plan) -> Vec<Vec<Lanes>> {
    plan.layers.iter().map(|layer| vec![[0.0; LANES]; layer.sums()]).collect()
}

/// From the gradients of what a ReLU gave to those of what it got.
fn mask(grads: &mut [f32], values: &[f32]) {
    vectorized(|| grads.iter_mut().zip(values).for_each(|(grad, &value)| *grad = relu_backward(value, *grad)));
}

/// All steps for one image, from the last; the gradient of the image itself is not needed. `grads` is laid out as
/// [`Plan::lean`], with zeros in the borders. Weights of a convolution before a ReLU get no gradients if a [`Group`] sees to
/// them.
fn backward(
    plan: &Plan,
    weights: &[Weights],
    values: &[f32],
    marks: &[u8],
    Workspace { wides, points }: &mut Workspace,
    grads: &mut [f32],
    sums: &mut [Vec<Lanes>],
    alone: bool,
) {
    let (kept, lean, layers) = (&plan.kept, &plan.lean, &plan.layers);
    for (number, step) in plan.steps.iter().enumerate().rev() {
        match *step {
            Step::Relu { layer, input, output } => {
                mask(lean.write(output, grads), kept.read(output, values));
                let (to, grad) = lean.two(input, output, grads);
                if alone {
                    layers[layer].add_gradients(kept.read(input, values), grad, points, &mut sums[layer]);
                }
                if number > 0 {
                    layers[layer].backward(grad, &weights[layer], points, to);
                }
            }
            Step::Pool { layer, input, output, wide, marks: from } => {
                let (to, grad) = lean.two(input, output, grads);
                let (buffer, grid, of) = (&mut wides[wide][..], plan.wides[wide], plan.slots[output]);
                pool::backward(grad, of, &marks[from..][..of.numbers()], buffer, grid);
                layers[layer].add_gradients(kept.read(input, values), buffer, points, &mut sums[layer]);
                if number > 0 {
                    layers[layer].backward(buffer, &weights[layer], points, to);
                }
            }
            Step::Residual { layers: [layer0, layer1], x, relu, inner } => {
                let (relu, hidden) = (kept.read(relu, values), kept.read(inner, values));
                let (x, inside) = lean.two(x, inner, grads);
                layers[layer1].add_gradients(hidden, x, points, &mut sums[layer1]);
                layers[layer1].backward_same(x, &weights[layer1], points, Write(inside));
                mask(inside, hidden);
                layers[layer0].add_gradients(relu, inside, points, &mut sums[layer0]);
                layers[layer0].backward_same(inside, &weights[layer0], points, AddWhere(x, relu));
            }
        }
    }
}

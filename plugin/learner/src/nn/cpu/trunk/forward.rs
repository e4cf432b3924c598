//! The forward pass: from images to features.

use super::layer::Weights;
use super::plan::{Layout, Plan, Step};
use super::pool;
use super::workspace::Workspace;
use crate::nn::cpu::fast_math::vectorized;
use crate::nn::cpu::kept_memory::KeptMemory;
use crate::nn::cpu::relu::relu;
use crate::nn::cpu::store::{Add, Write, WriteRelu};
use rayon::prelude::*;

/// Smallest number of images that a thread takes at a time.
const IMAGES: usize = 4;

/// The activations of all images for the backward pass.
#[derive(Debug)]
pub(super) struct SavedActivations {
    /// [`Plan::kept`] of each image.
    pub(super) values: KeptMemory,
    /// The marks of each image.
    pub(super) marks: Vec<u8>,
}

/// Returns only the features `[n, Plan::features]` of the images `[n, channels, height, width]`.
pub(super) fn features(plan: &Plan, weights: &[Weights], images: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; images.len() / image_len(plan) * plan.features()];
    let work = out.par_chunks_mut(plan.features()).zip(images.par_chunks(image_len(plan))).with_min_len(IMAGES);
    let scratch = || (Workspace::new(plan), vec![0.0; plan.lean.len], vec![0; plan.marks]);
    work.for_each_init(scratch, |(work, values, marks), (out, image)| {
        forward(plan, &plan.lean, weights, image, work, values, marks);
        write(plan, &plan.lean, values, out);
    });
    out
}

/// Does [`features`], and keeps the data for the backward pass.
pub(super) fn features_and_saved(plan: &Plan, weights: &[Weights], images: &[f32]) -> (Vec<f32>, SavedActivations) {
    let n = images.len() / image_len(plan);
    let mut out = vec![0.0; n * plan.features()];
    let mut saved = SavedActivations { values: KeptMemory::take(n * plan.kept.len), marks: vec![0; n * plan.marks] };
    let images = images.par_chunks(image_len(plan)).with_min_len(IMAGES);
    let work = out.par_chunks_mut(plan.features()).zip(images);
    let work = work.zip(saved.values.par_chunks_mut(plan.kept.len).zip(saved.marks.par_chunks_mut(plan.marks)));
    work.for_each_init(
        || Workspace::new(plan),
        |work, ((out, image), (values, marks))| {
            for (slot, grid) in plan.slots.iter().enumerate() {
                grid.clear_border(plan.kept.write(slot, values));
            }
            forward(plan, &plan.kept, weights, image, work, values, marks);
            write(plan, &plan.kept, values, out);
        },
    );
    (out, saved)
}

fn image_len(plan: &Plan) -> usize {
    plan.slots[0].numbers()
}

fn write(plan: &Plan, layout: &Layout, values: &[f32], out: &mut [f32]) {
    plan.slots[plan.last].write(layout.read(plan.last, values), out, relu);
}

/// Does all steps for one image. `values` has zeros in the borders.
fn forward(
    plan: &Plan,
    layout: &Layout,
    weights: &[Weights],
    image: &[f32],
    Workspace { wides, points }: &mut Workspace,
    values: &mut [f32],
    marks: &mut [u8],
) {
    plan.slots[0].read(image, layout.write(0, values));
    for step in &plan.steps {
        match *step {
            Step::Relu { layer, input, output } => {
                let (x, y) = layout.two(input, output, values);
                plan.layers[layer].forward(x, &weights[layer], points, WriteRelu(y));
            }
            Step::Pool { layer, input, output, wide, marks: from } => {
                let (x, y) = layout.two(input, output, values);
                let (buffer, grid, to) = (&mut wides[wide][..], plan.wides[wide], plan.slots[output]);
                plan.layers[layer].forward(x, &weights[layer], points, Write(buffer));
                pool::forward(buffer, grid, y, to, &mut marks[from..][..to.numbers()]);
            }
            Step::Residual { layers: [layer0, layer1], x, relu: slot, inner } => {
                let (from, to) = layout.two(x, slot, values);
                vectorized(|| from.iter().zip(to).for_each(|(x, y)| *y = relu(*x)));
                let (from, to) = layout.two(slot, inner, values);
                plan.layers[layer0].forward(from, &weights[layer0], points, WriteRelu(to));
                let (to, from) = layout.two(x, inner, values);
                plan.layers[layer1].forward(from, &weights[layer1], points, Add(to));
            }
        }
    }
}

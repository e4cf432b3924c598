//! The gradients of weights over several images at once.
//!
//! A layer with many weights and few pixels takes longer to fetch its sums than to add to them. If no memory of an
//! image is written twice, the gradients of several images are collected and added together. The order of the sums
//! stays the same.

use super::layer::Layer;
use super::plan::{Plan, Step};
use crate::nn::cpu::tile::Lanes;

/// Number of images that are taken together.
pub(super) const IMAGES: usize = 4;

/// Positions of the pixels of several images, layer by layer.
#[derive(Clone, Debug)]
pub(super) struct Group {
    layers: Vec<Places>,
}

#[derive(Clone, Debug)]
struct Places {
    /// Positions at which the windows of all images begin.
    starts: Vec<usize>,
    /// Positions of their outputs.
    outputs: Vec<usize>,
}

impl Group {
    /// Returns `None` if a stage writes memory twice, or has products of its own.
    pub(super) fn new(plan: &Plan) -> Option<Self> {
        let places = |step: &Step| match *step {
            Step::Relu { layer, input, output } if !plan.layers[layer].has_points => {
                Some(Places::new(&plan.layers[layer], plan.kept.start(input), plan.lean.start(output), plan))
            }
            _ => None,
        };
        Some(Self { layers: plan.steps.iter().map(places).collect::<Option<_>>()? })
    }

    /// Adds the gradients of `count` images to those of each layer; `values` and `grads` are those of all images.
    pub(super) fn add_gradients(
        &self,
        plan: &Plan,
        count: usize,
        values: &[f32],
        grads: &[f32],
        sums: &mut [&mut [Lanes]],
    ) {
        for ((layer, places), sums) in plan.layers.iter().zip(&self.layers).zip(sums) {
            let pixels = places.starts.len() / IMAGES * count;
            layer.add_gradients_at(values, &places.starts[..pixels], grads, &places.outputs[..pixels], sums);
        }
    }
}

impl Places {
    fn new(layer: &Layer, input: usize, output: usize, plan: &Plan) -> Self {
        let all = |places: &[usize], from: usize, step: usize| -> Vec<usize> {
            (0..IMAGES).flat_map(|image| places.iter().map(move |place| image * step + from + place)).collect()
        };
        Self { starts: all(&layer.starts, input, plan.kept.len), outputs: all(&layer.outputs, output, plan.lean.len) }
    }
}

//! All convolutions of an image encoder as one operation, for the flex backend.
//!
//! burn's convolutions write every window of an image before they multiply it, and every layer reads and writes the
//! whole batch. Here each image goes through all layers while it is in the cache, and the products read the windows
//! in place. Pixels lie with their channels last, in borders of zeros, so that a row of a window is contiguous. The
//! gradient of a layer's input is a convolution again (or, with strides, a sum of such rows).
//!
//! An image's features do not depend on the rest of the batch, and nothing depends on the number of threads.
//!
//! The folder, in reading order:
//!
//! - `grid`: the layout of one image's pixels in memory, and max-pooling.
//! - `layer`: one convolution of one image, and the plan of all stages.
//! - `winograd` and `products`: 3×3 convolutions with fewer products.

pub mod grid;
mod layer;
mod products;
#[cfg(test)]
mod tests;
mod winograd;

use crate::{
    elementwise::{Add, AddWhere, Write, WriteRelu, relu, relu_backward, vectorized},
    host_numbers::{HostNumbers, tensor},
    kept_memory::{KeptMemory, KeptWeights, OF_A_MOVE, share, share_each, share_with},
    tile::{LANES, Lanes},
    trunk::{
        grid::ConvShape,
        layer::{Group, Layer, Layout, Plan, StageShape, Step, Weights},
        winograd::PointBuffers,
    },
};
use burn::{
    backend::{
        Autodiff, Backend, Dispatch, DispatchDevice, Flex, TensorMetadata,
        autodiff::{
            checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
            grads::Gradients,
            ops::{Backward, Ops, OpsKind},
        },
        backend_extension,
        tensor::FloatTensor,
    },
    tensor::{Device, Tensor},
};
use std::{iter, sync::Arc};

pub use crate::trunk::grid::window_places;

/// Applies the stages and a last ReLU to images `[n, channels, height, width]`: features `[n, channels' * height' *
/// width']`. Returns `None` if this is not on flex, or for unsupported stages: every convolution must keep the size
/// of its image or have no padding.
///
/// Gradients reach the convolutions' parameters, never the pixels.
pub fn features(pixels: &Tensor<4>, stages: &[TrunkStage<'_>]) -> Option<Tensor<2>> {
    let [n, channels, height, width] = pixels.dims();
    if n == 0 || !is_flex(&pixels.device()) {
        return None;
    }
    let shapes: Vec<StageShape> = stages.iter().map(TrunkStage::shape).collect();
    let plan = Plan::new(&shapes, [channels, height, width])?;
    let flat = |conv: Conv<'_>| -> [Tensor<1>; 2] { [conv.weight.clone().flatten(0, 3), conv.bias.clone()] };
    let first = stages.iter().flat_map(TrunkStage::convs).next()?.weight.clone();
    let params = stages.iter().flat_map(TrunkStage::convs).flat_map(flat).collect();
    Some(trunk(pixels.clone(), Tensor::cat(params, 0), first, Arc::new(plan)))
}

/// Parameters of a convolution with a square kernel.
#[derive(Clone, Copy, Debug)]
pub struct Conv<'a> {
    /// `[outputs, inputs, kernel, kernel]`.
    pub weight: &'a Tensor<4>,
    /// `[outputs]`.
    pub bias: &'a Tensor<1>,
    /// Pixels from one position of the kernel to the next.
    pub stride: usize,
    /// Zeros around the image.
    pub padding: usize,
}

/// One stage of a trunk.
#[derive(Clone, Copy, Debug)]
pub enum TrunkStage<'a> {
    /// A convolution, then ReLU.
    Relu(Conv<'a>),
    /// A convolution, then max-pooling of 3×3 at every second pixel with padding 1.
    Pool(Conv<'a>),
    /// x + conv1(relu(conv0(relu(x)))).
    Residual(Conv<'a>, Conv<'a>),
}

impl<'a> TrunkStage<'a> {
    fn convs(&self) -> impl Iterator<Item = Conv<'a>> + use<'a> {
        let (first, second) = match *self {
            Self::Relu(conv) | Self::Pool(conv) => (conv, None),
            Self::Residual(conv0, conv1) => (conv0, Some(conv1)),
        };
        iter::once(first).chain(second)
    }

    fn shape(&self) -> StageShape {
        match self {
            Self::Relu(conv) => StageShape::Relu(shape(*conv)),
            Self::Pool(conv) => StageShape::Pool(shape(*conv)),
            Self::Residual(conv0, conv1) => StageShape::Residual([shape(*conv0), shape(*conv1)]),
        }
    }
}

fn shape(conv: Conv<'_>) -> ConvShape {
    let [outputs, inputs, kernel, _] = conv.weight.dims();
    ConvShape { inputs, outputs, kernel, stride: conv.stride, padding: conv.padding }
}

// The trunk as an operation of the flex backend, with its backward pass.

/// Returns whether `device` has this operation.
fn is_flex(device: &Device) -> bool {
    matches!(device.clone().inner().as_dispatch(), DispatchDevice::Flex(_))
}

/// Returns the features of `pixels`, on flex; `params` has the parameters of all layers, one after the other, and
/// `first` are the weights of the first, by which the network is known.
fn trunk(pixels: Tensor<4>, params: Tensor<1>, first: Tensor<4>, plan: Arc<Plan>) -> Tensor<2> {
    Tensor::from_dispatch(Dispatch::trunk(pixels.into_dispatch(), params.into_dispatch(), first.into_dispatch(), plan))
}

/// A backend with trunks.
#[backend_extension(Flex, Autodiff)]
trait Trunks: Backend {
    /// Returns the features as [`trunk`] does.
    fn trunk(
        pixels: FloatTensor<Self>,
        params: FloatTensor<Self>,
        first: FloatTensor<Self>,
        plan: Arc<Plan>,
    ) -> FloatTensor<Self>;
}

impl Trunks for Flex {
    fn trunk(
        pixels: FloatTensor<Self>,
        params: FloatTensor<Self>,
        first: FloatTensor<Self>,
        plan: Arc<Plan>,
    ) -> FloatTensor<Self> {
        let ordered = || weights(&plan, &Self::numbers(&params), false);
        let weights = KeptWeights::of::<Self, _>(&first, ordered);
        let values = features_of_images(&plan, &weights, &Self::numbers(&pixels));
        tensor::<Self>(values, [pixels.shape()[0], plan.features()], &pixels.device())
    }
}

impl<B: Trunks + HostNumbers, C: CheckpointStrategy> Trunks for Autodiff<B, C> {
    fn trunk(
        pixels: FloatTensor<Self>,
        params: FloatTensor<Self>,
        first: FloatTensor<Self>,
        plan: Arc<Plan>,
    ) -> FloatTensor<Self> {
        let ((pixels, _), (params, node)) = (pixels.into_parts(), params.into_parts());
        match Convolutions.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let weights = weights(&plan, &B::numbers(&params), true);
                let (values, saved) = features_and_saved(&plan, &weights, &B::numbers(&pixels));
                let values = tensor::<B>(values, [pixels.shape()[0], plan.features()], &pixels.device());
                prep.finish(Arc::new(Run { plan, weights, saved }), values)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::trunk(pixels, params, first.into_parts().0, plan)),
        }
    }
}

/// The data that a forward pass keeps for the backward pass.
#[derive(Debug)]
struct Run {
    plan: Arc<Plan>,
    weights: Vec<Weights>,
    saved: SavedActivations,
}

#[derive(Debug)]
struct Convolutions;

impl<B: Trunks + HostNumbers> Backward<B, 1> for Convolutions {
    type State = Arc<Run>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let grad = grads.consume::<B>(&ops.node);
        let (run, [params]) = (ops.state, ops.parents);
        if let Some(params) = params {
            let found = gradients(&run.plan, &run.weights, &run.saved, &B::numbers(&grad));
            let len = found.len();
            grads.register::<B>(params.id, tensor::<B>(found, [len], &grad.device()));
        }
    }
}

fn weights(plan: &Plan, mut params: &[f32], backward: bool) -> Vec<Weights> {
    let mut of_layers = Vec::new();
    for layer in &plan.layers {
        let (own, rest) = params.split_at(layer.params());
        of_layers.push(own);
        params = rest;
    }
    let numbers: usize = of_layers.iter().map(|params| params.len()).sum();
    let mut found: Vec<_> = plan.layers.iter().zip(of_layers).map(|(layer, params)| (layer, params, None)).collect();
    share_each(&mut found, numbers * OF_A_MOVE, |_, (layer, params, to)| *to = Some(layer.weights(params, backward)));
    found.into_iter().filter_map(|(_, _, weights)| weights).collect()
}

// The forward pass: from images to features.

/// Number of images that a thread takes at a time.
const IMAGES: usize = 4;

/// Number of products that take as long as the smallest of networks for an image.
const OF_AN_IMAGE: usize = 1 << 20;

/// The activations of all images for the backward pass.
#[derive(Debug)]
struct SavedActivations {
    /// [`Plan::kept`] of each image.
    values: KeptMemory,
    /// The marks of each image.
    marks: Vec<u8>,
}

/// Returns only the features `[n, Plan::features]` of the images `[n, channels, height, width]`.
fn features_of_images(plan: &Plan, weights: &[Weights], images: &[f32]) -> Vec<f32> {
    let n = images.len() / image_len(plan);
    let mut out = vec![0.0; n * plan.features()];
    let scratch = || (Workspace::new(plan), vec![0.0; plan.lean.len], vec![0; plan.marks]);
    let piece = IMAGES * plan.features();
    share_with(&mut out, piece, n * OF_AN_IMAGE, scratch, |(work, values, marks), piece, out| {
        let images = images.chunks_exact(image_len(plan)).skip(piece * IMAGES);
        for (out, image) in out.chunks_exact_mut(plan.features()).zip(images) {
            forward(plan, &plan.lean, weights, image, work, values, marks);
            write(plan, &plan.lean, values, out);
        }
    });
    out
}

/// Does [`features_of_images`], and keeps the data for the backward pass.
fn features_and_saved(plan: &Plan, weights: &[Weights], images: &[f32]) -> (Vec<f32>, SavedActivations) {
    let n = images.len() / image_len(plan);
    let mut out = vec![0.0; n * plan.features()];
    let mut saved = SavedActivations { values: KeptMemory::take(n * plan.kept.len), marks: vec![0; n * plan.marks] };
    let memory = saved.values.chunks_mut(plan.kept.len).zip(saved.marks.chunks_mut(plan.marks));
    let images = images.chunks_exact(image_len(plan));
    let mut all: Vec<_> = out.chunks_exact_mut(plan.features()).zip(images).zip(memory).collect();
    share_with(
        &mut all,
        IMAGES,
        n * OF_AN_IMAGE,
        || Workspace::new(plan),
        |work, _, images| {
            for ((out, image), (values, marks)) in images {
                for (slot, grid) in plan.slots.iter().enumerate() {
                    grid.clear_border(plan.kept.write(slot, values));
                }
                forward(plan, &plan.kept, weights, image, work, values, marks);
                write(plan, &plan.kept, values, out);
            }
        },
    );
    drop(all);
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
                grid::pool(buffer, grid, y, to, &mut marks[from..][..to.numbers()]);
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

// The backward pass: from the gradient of the features to those of the parameters.

/// Number of parts into which a batch is split, each with its own sums of gradients.
const PARTS: usize = 32;

/// Smallest number of images of a part.
const BACKWARD_IMAGES: usize = 8;

/// Sums of a part that a thread adds at a time.
const SUMS: usize = 1 << 13;

/// Returns the gradients of all parameters, layer by layer, for the gradient `[n, Plan::features]` of the features.
///
/// The parts depend on the batch alone and are added in order, so the sums are the same on any number of threads.
fn gradients(plan: &Plan, weights: &[Weights], saved: &SavedActivations, grad: &[f32]) -> Vec<f32> {
    let n = grad.len() / plan.features();
    let part = n.div_ceil(PARTS).max(BACKWARD_IMAGES);
    let group = Group::new(plan);
    let at_once = if group.is_some() { layer::IMAGES } else { 1 };
    let (kept_len, lean_len) = (plan.kept.len, plan.lean.len);
    let memory = || (Workspace::new(plan), KeptMemory::zeros(at_once * lean_len));
    let mut parts: Vec<Option<KeptMemory>> = (0..n.div_ceil(part)).map(|_| None).collect();
    share_with(&mut parts, 1, n * OF_AN_IMAGE, memory, |(work, grads), i, of_part| {
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
        of_part[0] = Some(memory);
    });
    let mut parts: Vec<KeptMemory> = parts.into_iter().flatten().collect();
    let mut params = KeptMemory::take(plan.layers.iter().map(Layer::params).sum()).into_vec();
    let Some((total, others)) = parts.split_first_mut() else { return vec![0.0; params.len()] };
    let adds = others.len() * total.len();
    share(total, SUMS, adds * OF_A_MOVE, |piece, total| {
        for part in &*others {
            let pairs = total.iter_mut().zip(&part[piece * SUMS..]);
            vectorized(|| pairs.for_each(|(sum, x)| *sum += x));
        }
    });
    let totals = by_layer(plan, total.as_chunks_mut::<LANES>().0, Layer::sums);
    let of_layers = plan.layers.iter().zip(totals).zip(by_layer(plan, &mut params, Layer::params));
    let mut of_layers: Vec<_> = of_layers.collect();
    share_each(&mut of_layers, adds * OF_A_MOVE, |_, ((layer, total), params)| layer.gradients(total, params));
    drop(of_layers);
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
                grid::pool_backward(grad, of, &marks[from..][..of.numbers()], buffer, grid);
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

/// Working memory of a thread: buffers that are needed only briefly, for one image at a time.
#[derive(Debug)]
struct Workspace {
    /// Stages before their pooling.
    wides: Vec<Vec<f32>>,
    /// Convolutions with fewer products.
    points: PointBuffers,
}

impl Workspace {
    fn new(plan: &Plan) -> Self {
        let wides = plan.wides.iter().map(|grid| vec![0.0; grid.len()]).collect();
        Self { wides, points: PointBuffers::default() }
    }
}

//! The layers as an operation of the flex backend, with its backward pass.

use super::backward::{Wanted, backward};
use super::forward::{Layer, MOST_LAYERS, forward};
use crate::nn::Activation;
use crate::nn::cpu::host_numbers::{HostNumbers, tensor};
use crate::nn::cpu::kept_memory::KeptMemory;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{
    Autodiff, Backend, Dispatch, DispatchDevice, ExtensionType, Flex, TensorMetadata, backend_extension,
};
use burn::tensor::Tensor;
use std::borrow::Cow;
use std::sync::Arc;

/// A layer: the activation of x W + b, if there is one.
#[derive(Clone, Copy, Debug)]
pub(in crate::nn) struct Dense<'a> {
    /// W, `[inputs, outputs]`.
    pub(in crate::nn) weight: &'a Tensor<2>,
    /// b, `[outputs]`.
    pub(in crate::nn) bias: &'a Tensor<1>,
    /// Applied to every output; none for a linear layer.
    pub(in crate::nn) activation: Option<Activation>,
}

/// Applies the layers, one after the other: `[n, outputs of the last]` for x `[n, inputs]`. Returns `None` if this is
/// not on flex.
pub(in crate::nn) fn dense(x: &Tensor<2>, layers: &[Dense<'_>]) -> Option<Tensor<2>> {
    let is_flex = matches!(x.device().inner().as_dispatch(), DispatchDevice::Flex(_));
    if !is_flex || x.dims().contains(&0) || layers.iter().any(|layer| layer.weight.dims().contains(&0)) {
        return None;
    }
    let through = |x: Tensor<2>, layers: &[Dense<'_>]| {
        let activations = layers.iter().map(|layer| layer.activation).collect();
        Tensor::from_dispatch(Dispatch::dense(x.into_dispatch(), Params::new(layers), activations))
    };
    Some(layers.chunks(MOST_LAYERS).fold(x.clone(), through))
}

/// W and b of each layer in turn, for one to [`MOST_LAYERS`] layers.
#[derive(ExtensionType)]
pub(super) enum Params<B: Backend> {
    One(FloatTensor<B>, FloatTensor<B>),
    Two(FloatTensor<B>, FloatTensor<B>, FloatTensor<B>, FloatTensor<B>),
    Three(FloatTensor<B>, FloatTensor<B>, FloatTensor<B>, FloatTensor<B>, FloatTensor<B>, FloatTensor<B>),
}

impl Params<Dispatch> {
    fn new(layers: &[Dense<'_>]) -> Self {
        let w = |layer: &Dense<'_>| layer.weight.clone().into_dispatch();
        let b = |layer: &Dense<'_>| layer.bias.clone().into_dispatch();
        match layers {
            [one] => Self::One(w(one), b(one)),
            [one, two] => Self::Two(w(one), b(one), w(two), b(two)),
            [one, two, three] => Self::Three(w(one), b(one), w(two), b(two), w(three), b(three)),
            _ => unreachable!("one to three"),
        }
    }
}

/// A backend with dense layers.
#[backend_extension(Flex, Autodiff)]
pub(super) trait DenseLayers: Backend {
    /// Applies the layers as [`dense`] does, with the activation of each layer.
    fn dense(
        x: FloatTensor<Self>,
        #[extension_type] params: Params<Self>,
        activations: Vec<Option<Activation>>,
    ) -> FloatTensor<Self>;
}

impl DenseLayers for Flex {
    fn dense(x: FloatTensor<Self>, params: Params<Self>, activations: Vec<Option<Activation>>) -> FloatTensor<Self> {
        let params = match params {
            Params::One(w, b) => vec![w, b],
            Params::Two(w0, b0, w1, b1) => vec![w0, b0, w1, b1],
            Params::Three(w0, b0, w1, b1, w2, b2) => vec![w0, b0, w1, b1, w2, b2],
        };
        forwards::<Self>(&x, &params, &activations).1
    }
}

impl<B: DenseLayers + HostNumbers, C: CheckpointStrategy> DenseLayers for Autodiff<B, C> {
    fn dense(x: FloatTensor<Self>, params: Params<Self>, activations: Vec<Option<Activation>>) -> FloatTensor<Self> {
        match params {
            Params::One(w, b) => recorded::<B, C, _>([x, w, b], activations),
            Params::Two(w0, b0, w1, b1) => recorded::<B, C, _>([x, w0, b0, w1, b1], activations),
            Params::Three(w0, b0, w1, b1, w2, b2) => recorded::<B, C, _>([x, w0, b0, w1, b1, w2, b2], activations),
        }
    }
}

/// Records the operation on x and the parameters as a node of the gradient graph.
fn recorded<B: DenseLayers + HostNumbers, C: CheckpointStrategy, const N: usize>(
    tensors: [FloatTensor<Autodiff<B, C>>; N],
    activations: Vec<Option<Activation>>,
) -> FloatTensor<Autodiff<B, C>> {
    let mut plain = Vec::with_capacity(N);
    let nodes = tensors.map(|tensor| {
        let (tensor, node) = tensor.into_parts();
        plain.push(tensor);
        node
    });
    let (hidden, y) = forwards::<B>(&plain[0], &plain[1..], &activations);
    match DenseBackward.prepare::<C>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prep) => {
            prep.finish(Pass { tensors: plain, hidden: Arc::new(hidden), y: y.clone(), activations }, y)
        }
        OpsKind::UnTracked(prep) => prep.finish(y),
    }
}

/// Returns the numbers of weights and biases.
fn numbers<B: HostNumbers>(params: &[FloatTensor<B>]) -> Vec<Cow<'_, [f32]>> {
    params.iter().map(B::numbers).collect()
}

fn layers<'a>(params: &'a [Cow<'_, [f32]>], activations: &[Option<Activation>]) -> Vec<Layer<'a>> {
    let pairs = params.as_chunks().0.iter().zip(activations);
    pairs.map(|([weights, bias], &activation)| Layer { weights, bias, activation }).collect()
}

/// Returns the outputs of all layers but the last, and that of the last.
fn forwards<B: HostNumbers>(
    x: &FloatTensor<B>,
    params: &[FloatTensor<B>],
    activations: &[Option<Activation>],
) -> (Vec<KeptMemory>, FloatTensor<B>) {
    let params = numbers::<B>(params);
    let (hidden, y) = forward(&B::numbers(x), &layers(&params, activations));
    let n = x.shape()[0];
    let outputs = y.len() / n;
    (hidden, tensor::<B>(y, [n, outputs], &x.device()))
}

#[derive(Debug)]
struct DenseBackward;

/// The data that the forward pass keeps for the backward pass.
#[derive(Clone, Debug)]
struct Pass<B: Backend> {
    /// x, then W and b of each layer.
    tensors: Vec<FloatTensor<B>>,
    /// The outputs of all layers but the last.
    hidden: Arc<Vec<KeptMemory>>,
    /// The output of the last layer.
    y: FloatTensor<B>,
    activations: Vec<Option<Activation>>,
}

impl<B: DenseLayers + HostNumbers, const N: usize> Backward<B, N> for DenseBackward {
    type State = Pass<B>;

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let grad = grads.consume::<B>(&ops.node);
        let Pass { tensors, hidden, y, activations } = ops.state;
        let [x, params @ ..] = tensors.as_slice() else { unreachable!("it has layers") };
        let (y, numbers) = (B::numbers(&y), numbers::<B>(params));
        let outputs: Vec<&[f32]> = hidden.iter().map(|hidden| &**hidden).chain([&*y]).collect();
        let [of_x, of_params @ ..] = ops.parents.as_slice() else { unreachable!("it has layers") };
        let wanted = Wanted { x: of_x.is_some(), params: of_params.iter().any(Option::is_some) };
        let layers = layers(&numbers, &activations);
        let (of_rows, of_layers) = backward(&B::numbers(&grad), &B::numbers(x), &layers, &outputs, wanted);
        let found = of_layers.into_iter().flat_map(|grads| [grads.weights, grads.bias]);
        let found = found.zip(params).zip(of_params).chain(wanted.x.then_some(((of_rows, x), of_x)));
        for ((values, like), node) in found {
            if let Some(node) = node {
                grads.register::<B>(node.id, tensor::<B>(values, like.shape(), &grad.device()));
            }
        }
    }
}

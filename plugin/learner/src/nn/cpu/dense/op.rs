//! The layer as an operation of the flex backend, with its backward pass.

use super::backward::SumGrads;
use super::forward::product;
use super::packed::Packed;
use crate::nn::Activation;
use crate::nn::cpu::host_numbers::{HostNumbers, tensor};
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, DispatchDevice, Flex, TensorMetadata, backend_extension};
use burn::tensor::Tensor;

/// The activation of x W + b, if there is one: `[n, outputs]` for x `[n, inputs]`, W `[inputs, outputs]` and b `[outputs]`.
/// `None` if this is not on flex.
pub(in crate::nn) fn dense(
    x: &Tensor<2>,
    weight: &Tensor<2>,
    bias: &Tensor<1>,
    activation: Option<Activation>,
) -> Option<Tensor<2>> {
    let is_flex = matches!(x.device().inner().as_dispatch(), DispatchDevice::Flex(_));
    if !is_flex || x.dims().contains(&0) || weight.dims().contains(&0) {
        return None;
    }
    let [x, weight] = [x, weight].map(|tensor| tensor.clone().into_dispatch());
    Some(Tensor::from_dispatch(Dispatch::dense(x, weight, bias.clone().into_dispatch(), activation)))
}

/// What a backend with dense layers can do.
#[backend_extension(Flex, Autodiff)]
pub(super) trait DenseLayers: Backend {
    /// As [`dense`].
    fn dense(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        activation: Option<Activation>,
    ) -> FloatTensor<Self>;
}

impl DenseLayers for Flex {
    fn dense(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        activation: Option<Activation>,
    ) -> FloatTensor<Self> {
        let (shape, device) = (weight.shape(), x.device());
        let (n, inputs, outputs) = (x.shape()[0], shape[0], shape[1]);
        let weights = Packed::new(&Self::numbers(&weight), inputs, outputs);
        let out = product(&Self::numbers(&x), (n, inputs), &weights, &Self::numbers(&bias), activation);
        tensor::<Self>(out, [n, outputs], &device)
    }
}

impl<B: DenseLayers + HostNumbers, C: CheckpointStrategy> DenseLayers for Autodiff<B, C> {
    fn dense(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        activation: Option<Activation>,
    ) -> FloatTensor<Self> {
        let parts = [x, weight, bias].map(|tensor| tensor.into_parts());
        let [(x, of_x), (weight, of_weight), (bias, of_bias)] = parts;
        let y = B::dense(x.clone(), weight.clone(), bias, activation);
        match Dense.prepare::<C>([of_x, of_weight, of_bias]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((x, weight, y.clone(), activation), y),
            OpsKind::UnTracked(prep) => prep.finish(y),
        }
    }
}

#[derive(Debug)]
struct Dense;

impl<B: DenseLayers + HostNumbers> Backward<B, 3> for Dense {
    /// x, W, the output and its activation.
    type State = (FloatTensor<B>, FloatTensor<B>, FloatTensor<B>, Option<Activation>);

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let grad = grads.consume::<B>(&ops.node);
        let ((x, weight, y, activation), [of_x, of_weight, of_bias]) = (ops.state, ops.parents);
        let (device, [inputs, outputs]) = (grad.device(), [weight.shape()[0], weight.shape()[1]]);
        let sums = SumGrads::new(&B::numbers(&grad), &B::numbers(&y), outputs, activation);
        if of_weight.is_some() || of_bias.is_some() {
            let (weights, biases) = sums.params(&B::numbers(&x), inputs);
            if let Some(node) = of_weight {
                grads.register::<B>(node.id, tensor::<B>(weights, [inputs, outputs], &device));
            }
            if let Some(node) = of_bias {
                grads.register::<B>(node.id, tensor::<B>(biases, [outputs], &device));
            }
        }
        if let Some(node) = of_x {
            let n = x.shape()[0];
            grads.register::<B>(node.id, tensor::<B>(sums.input(&B::numbers(&weight)), [n, inputs], &device));
        }
    }
}

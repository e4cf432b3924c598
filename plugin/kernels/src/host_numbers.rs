//! Conversion between tensors and numbers in host memory.

#![allow(deprecated, reason = "ndarray is kept as a second opinion on flex")]

use burn::{
    backend::{
        Autodiff, Backend, Dispatch, DispatchDevice, Flex, NdArray, TensorMetadata,
        autodiff::{
            checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
            grads::Gradients,
            ops::{Backward, Ops, OpsKind},
        },
        backend_extension,
        tensor::FloatTensor,
    },
    tensor::{Device, Shape, Tensor, TensorData, read_sync},
};
use std::borrow::Cow;

/// Returns whether the numbers of `device` lie in host memory, where reading them costs nothing.
pub fn is_host(device: &Device) -> bool {
    matches!(device.clone().inner().as_dispatch(), DispatchDevice::Flex(_) | DispatchDevice::NdArray(_))
}

/// A backend whose numbers can be read, without a copy if possible.
pub(crate) trait HostNumbers: Backend {
    /// Returns the numbers, row-major.
    fn numbers(tensor: &FloatTensor<Self>) -> Cow<'_, [f32]>;
}

impl HostNumbers for Flex {
    fn numbers(tensor: &FloatTensor<Self>) -> Cow<'_, [f32]> {
        let copy = || tensor.to_contiguous().as_slice().map(<[f32]>::to_vec);
        let values = tensor.as_slice().map(Cow::Borrowed).or_else(|| copy().map(Cow::Owned));
        values.expect("a tensor in row-major order can be read")
    }
}

impl HostNumbers for NdArray {
    fn numbers(tensor: &FloatTensor<Self>) -> Cow<'_, [f32]> {
        let data = data::<Self>(tensor.clone());
        Cow::Owned(data.into_vec().expect("tensors are made of f32"))
    }
}

/// Returns the numbers of a tensor in host memory; copies only if they are shared.
pub(crate) fn data<B: Backend>(tensor: FloatTensor<B>) -> TensorData {
    read_sync(B::float_into_data(tensor)).expect("a backend with kernels has its numbers in host memory")
}

/// Creates a tensor of `values`.
pub(crate) fn tensor<B: Backend>(values: Vec<f32>, shape: impl Into<Shape>, device: &B::Device) -> FloatTensor<B> {
    B::float_from_data(TensorData::new(values, shape), device)
}

// A number that was computed elsewhere, together with its gradient, as a node of the gradient graph.

/// Returns the number `value`, `[1]`, whose gradient by `x` is `gradient`, of the shape of `x`. On a device with
/// kernels.
pub fn known_gradient<const D: usize>(x: Tensor<D>, value: f32, gradient: Vec<f32>) -> Tensor<1> {
    Tensor::from_dispatch(Dispatch::known_gradient(x.into_dispatch(), value, gradient))
}

/// A backend with numbers in host memory.
#[backend_extension(Flex, NdArray, Autodiff)]
pub(crate) trait KnownGradient: Backend {
    /// Adds the node as [`known_gradient`] does.
    fn known_gradient(x: FloatTensor<Self>, value: f32, gradient: Vec<f32>) -> FloatTensor<Self>;
}

impl KnownGradient for Flex {
    fn known_gradient(x: FloatTensor<Self>, value: f32, _: Vec<f32>) -> FloatTensor<Self> {
        tensor::<Self>(vec![value], [1], &x.device())
    }
}

impl KnownGradient for NdArray {
    fn known_gradient(x: FloatTensor<Self>, value: f32, _: Vec<f32>) -> FloatTensor<Self> {
        tensor::<Self>(vec![value], [1], &x.device())
    }
}

impl<B: KnownGradient + HostNumbers, C: CheckpointStrategy> KnownGradient for Autodiff<B, C> {
    fn known_gradient(x: FloatTensor<Self>, value: f32, gradient: Vec<f32>) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        let value = tensor::<B>(vec![value], [1], &x.device());
        match Known.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(tensor::<B>(gradient, x.shape(), &x.device()), value),
            OpsKind::UnTracked(prep) => prep.finish(value),
        }
    }
}

#[derive(Debug)]
struct Known;

impl<B: KnownGradient + HostNumbers> Backward<B, 1> for Known {
    /// The gradient by x.
    type State = FloatTensor<B>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let times = B::numbers(&grads.consume::<B>(&ops.node))[0];
        let [Some(node)] = ops.parents else { return };
        let gradient = if times == 1.0 { ops.state } else { B::float_mul_scalar(ops.state, times.into()) };
        grads.register::<B>(node.id, gradient);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_learner::DeviceKind;
    use playbot_learner::nn::{host, matrix, scalar};

    #[test]
    fn the_gradient_is_what_was_said() {
        for device in [DeviceKind::Flex, DeviceKind::Ndarray] {
            let x = matrix(vec![1.0, 2.0, 3.0, 4.0], 2, 2, &device.plain().autodiff()).require_grad();
            let loss = known_gradient(x.clone() * 2.0, 7.0, vec![1.0, -1.0, 0.5, 0.0]) * 3.0;
            assert_eq!(scalar(loss.clone().inner()).expect("readable"), 21.0);
            let grads = loss.backward();
            let of_x = host(x.grad(&grads).expect("tracked")).expect("readable");
            assert_eq!(of_x, [6.0, -6.0, 3.0, 0.0]);
        }
    }

    #[test]
    fn without_a_graph_it_is_a_number() {
        let x = matrix(vec![1.0], 1, 1, &DeviceKind::Flex.plain());
        assert_eq!(scalar(known_gradient(x, 5.0, vec![1.0])).expect("readable"), 5.0);
    }
}

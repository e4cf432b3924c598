//! Operations with loops of our own, for the backends whose numbers are in host memory.
//!
//! Each has its backward pass beside it and enters the gradient graph as one node. Devices without a kernel
//! ([`has_kernels`]) take the path of plain tensor operations instead.

#![allow(deprecated, reason = "ndarray is kept as a second opinion on flex")]

use super::fast_math;
use super::gru_scan::{self, Scan, ScanGrads};
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind, unary};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, DispatchDevice, Flex, NdArray, TensorMetadata, backend_extension};
use burn::tensor::{Device, Shape, Tensor, TensorData, read_sync};
use std::sync::Arc;

/// Whether the operations of this file can be used on `device`.
pub(in crate::nn) fn has_kernels(device: &Device) -> bool {
    let device = device.clone().inner();
    matches!(device.as_dispatch(), DispatchDevice::Flex(_) | DispatchDevice::NdArray(_))
}

/// tanh of every element, on a device with kernels.
pub(in crate::nn) fn tanh<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    Tensor::from_dispatch(Dispatch::kernel_tanh(x.into_dispatch()))
}

/// What the recurrent part of a layer of T steps works on.
#[derive(Clone, Debug)]
pub(in crate::nn) struct GruInput {
    /// x W_ih without its bias, time-major, `[directions, T * B, 3 * hidden]`.
    pub(in crate::nn) input: Tensor<3>,
    /// W_hh, `[directions, hidden, 3 * hidden]`.
    pub(in crate::nn) weight: Tensor<3>,
    /// `[directions, 3 * hidden]`.
    pub(in crate::nn) bias_ih: Tensor<2>,
    /// `[directions, 3 * hidden]`.
    pub(in crate::nn) bias_hh: Tensor<2>,
    /// The states before the first step, `[directions, B, hidden]`.
    pub(in crate::nn) initial: Tensor<3>,
}

/// The recurrent part of a layer on a device with kernels: `[T * B, directions * hidden]`.
pub(in crate::nn) fn gru(input: GruInput) -> Tensor<2> {
    let GruInput { input, weight, bias_ih, bias_hh, initial } = input;
    Tensor::from_dispatch(Dispatch::kernel_gru(
        input.into_dispatch(),
        weight.into_dispatch(),
        bias_ih.into_dispatch(),
        bias_hh.into_dispatch(),
        initial.into_dispatch(),
    ))
}

/// What a backend with kernels can do.
#[backend_extension(Flex, NdArray, Autodiff)]
pub(super) trait Kernels: Backend {
    /// tanh of every element.
    fn kernel_tanh(x: FloatTensor<Self>) -> FloatTensor<Self>;

    /// The recurrent part of a layer, with the tensors of [`GruInput`]. Gives `[T * B, directions * hidden]`.
    fn kernel_gru(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias_ih: FloatTensor<Self>,
        bias_hh: FloatTensor<Self>,
        initial: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

macro_rules! host_kernels {
    ($backend:ty) => {
        impl Kernels for $backend {
            fn kernel_tanh(x: FloatTensor<Self>) -> FloatTensor<Self> {
                edited::<Self>(x, fast_math::tanh_in_place)
            }

            fn kernel_gru(
                input: FloatTensor<Self>,
                weight: FloatTensor<Self>,
                bias_ih: FloatTensor<Self>,
                bias_hh: FloatTensor<Self>,
                initial: FloatTensor<Self>,
            ) -> FloatTensor<Self> {
                gru_scan::forward::<Self>(input, weight, bias_ih, bias_hh, initial).0
            }
        }
    };
}

host_kernels!(Flex);
host_kernels!(NdArray);

impl<B: Kernels, C: CheckpointStrategy> Kernels for Autodiff<B, C> {
    fn kernel_tanh(x: FloatTensor<Self>) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        let y = B::kernel_tanh(x);
        match Tanh.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(y.clone(), y),
            OpsKind::UnTracked(prep) => prep.finish(y),
        }
    }

    fn kernel_gru(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias_ih: FloatTensor<Self>,
        bias_hh: FloatTensor<Self>,
        initial: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let parts = [input, weight, bias_ih, bias_hh, initial].map(|tensor| tensor.into_parts());
        let [(input, n0), (weight, n1), (bias_ih, n2), (bias_hh, n3), (initial, n4)] = parts;
        let (output, scan) = gru_scan::forward::<B>(input, weight.clone(), bias_ih, bias_hh, initial);
        match GruScan.prepare::<C>([n0, n1, n2, n3, n4]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((Arc::new(scan), weight), output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    }
}

#[derive(Debug)]
struct Tanh;

impl<B: Kernels> Backward<B, 1> for Tanh {
    type State = FloatTensor<B>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let y = data::<B>(ops.state);
        unary::<B, _>(ops.parents, ops.node, grads, |grad| {
            edited::<B>(grad, |grad| fast_math::tanh_backward(grad, numbers(&y)))
        });
    }
}

#[derive(Debug)]
struct GruScan;

impl<B: Kernels> Backward<B, 5> for GruScan {
    /// What the forward pass left, and W_hh.
    type State = (Arc<Scan>, FloatTensor<B>);

    fn backward(self, ops: Ops<Self::State, 5>, grads: &mut Gradients, _: &mut Checkpointer) {
        let output = grads.consume::<B>(&ops.node);
        let (scan, weight) = ops.state;
        let [input, hidden, bias_ih, bias_hh, initial] = ops.parents;
        let found = gru_scan::backward::<B>(output, &scan, weight, initial.is_some());
        let ScanGrads { input: d_input, weight: d_weight, bias_ih: d_bias_ih, bias_hh: d_bias_hh, initial: d_initial } =
            found;
        let pairs =
            [(input, d_input), (hidden, d_weight), (bias_ih, d_bias_ih), (bias_hh, d_bias_hh), (initial, d_initial)];
        for (node, grad) in pairs {
            if let Some(node) = node {
                grads.register::<B>(node.id, grad);
            }
        }
    }
}

/// The numbers of a tensor in host memory; a copy only if they are shared.
pub(super) fn data<B: Backend>(tensor: FloatTensor<B>) -> TensorData {
    read_sync(B::float_into_data(tensor)).expect("a backend with kernels has its numbers in host memory")
}

/// The numbers of host data.
pub(super) fn numbers(data: &TensorData) -> &[f32] {
    data.as_slice().expect("tensors are made of f32")
}

/// A tensor of `values`.
pub(super) fn tensor<B: Backend>(values: Vec<f32>, shape: impl Into<Shape>, device: &B::Device) -> FloatTensor<B> {
    B::float_from_data(TensorData::new(values, shape), device)
}

/// The tensor after `edit`; a copy only if it is shared.
fn edited<B: Backend>(tensor: FloatTensor<B>, edit: impl FnOnce(&mut [f32])) -> FloatTensor<B> {
    let device = tensor.device();
    let mut data = data::<B>(tensor);
    edit(data.as_mut_slice().expect("tensors are made of f32"));
    B::float_from_data(data, &device)
}

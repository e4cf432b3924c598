//! Operations on tensors for the backends whose numbers are in host memory: tanh, log-softmax and recurrent layers.
//!
//! Each has its backward pass beside it and enters the gradient graph as one node. Devices without a kernel (see
//! [`is_host`]) use plain tensor operations instead.

#![allow(deprecated, reason = "ndarray is kept as a second opinion on flex")]

use crate::{
    elementwise,
    elementwise::{Activation, log_softmax_backward, log_softmax_in_place},
    gru_scan,
    gru_scan::{ScanGrads, ScanInput, ScanRecord, Sizes, Wanted},
    host_numbers::{HostNumbers, data, is_host, tensor},
};
use burn::{
    backend::{
        Autodiff, Backend, Dispatch, Flex, NdArray, TensorMetadata,
        autodiff::{
            checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
            grads::Gradients,
            ops::{Backward, Ops, OpsKind, unary},
        },
        backend_extension,
        tensor::FloatTensor,
    },
    tensor::{Shape, Tensor, activation},
};
use std::sync::Arc;

/// Returns tanh of every element, on a device with kernels.
pub fn tanh<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    Tensor::from_dispatch(Dispatch::kernel_tanh(x.into_dispatch()))
}

impl Activation {
    /// Applies the function to every element.
    pub fn forward<const D: usize>(self, x: Tensor<D>) -> Tensor<D> {
        match self {
            Self::Relu => activation::relu(x),
            Self::Tanh if is_host(&x.device()) => tanh(x),
            Self::Tanh => x.tanh(),
        }
    }
}

/// Returns log-probabilities for the logits in the rows of `x`, on a device with kernels.
pub fn log_softmax(x: Tensor<2>) -> Tensor<2> {
    Tensor::from_dispatch(Dispatch::kernel_log_softmax(x.into_dispatch()))
}

/// The inputs of a recurrent layer of T steps.
#[derive(Clone, Debug)]
pub struct GruInput {
    /// Time-major, `[T * B, inputs]`.
    pub x: Tensor<2>,
    /// W_ih, `[directions, inputs, 3 * hidden]`.
    pub weight_ih: Tensor<3>,
    /// W_hh, `[directions, hidden, 3 * hidden]`.
    pub weight_hh: Tensor<3>,
    /// `[directions, 3 * hidden]`.
    pub bias_ih: Tensor<2>,
    /// `[directions, 3 * hidden]`.
    pub bias_hh: Tensor<2>,
    /// The states before the first step, `[directions, B, hidden]`.
    pub initial: Tensor<3>,
}

/// Applies a layer on a device with kernels: `[T * B, directions * hidden]`.
pub fn gru(input: GruInput) -> Tensor<2> {
    let GruInput { x, weight_ih, weight_hh, bias_ih, bias_hh, initial } = input;
    Tensor::from_dispatch(Dispatch::kernel_gru(
        x.into_dispatch(),
        weight_ih.into_dispatch(),
        weight_hh.into_dispatch(),
        bias_ih.into_dispatch(),
        bias_hh.into_dispatch(),
        initial.into_dispatch(),
    ))
}

/// A backend with kernels.
#[backend_extension(Flex, NdArray, Autodiff)]
pub(crate) trait Kernels: Backend {
    /// Returns tanh of every element.
    fn kernel_tanh(x: FloatTensor<Self>) -> FloatTensor<Self>;

    /// Returns ln softmax of each row.
    fn kernel_log_softmax(x: FloatTensor<Self>) -> FloatTensor<Self>;

    /// Applies a recurrent layer, with the tensors of [`GruInput`]. Returns `[T * B, directions * hidden]`.
    fn kernel_gru(
        x: FloatTensor<Self>,
        weight_ih: FloatTensor<Self>,
        weight_hh: FloatTensor<Self>,
        bias_ih: FloatTensor<Self>,
        bias_hh: FloatTensor<Self>,
        initial: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

macro_rules! host_kernels {
    ($backend:ty) => {
        impl Kernels for $backend {
            fn kernel_tanh(x: FloatTensor<Self>) -> FloatTensor<Self> {
                edited::<Self>(x, elementwise::tanh_in_place)
            }

            fn kernel_log_softmax(x: FloatTensor<Self>) -> FloatTensor<Self> {
                let choices = x.shape()[1];
                edited::<Self>(x, |x| log_softmax_in_place(x, choices))
            }

            fn kernel_gru(
                x: FloatTensor<Self>,
                weight_ih: FloatTensor<Self>,
                weight_hh: FloatTensor<Self>,
                bias_ih: FloatTensor<Self>,
                bias_hh: FloatTensor<Self>,
                initial: FloatTensor<Self>,
            ) -> FloatTensor<Self> {
                scanned::<Self>(&x, [&weight_ih, &weight_hh], [&bias_ih, &bias_hh], &initial).0
            }
        }
    };
}

host_kernels!(Flex);

host_kernels!(NdArray);

impl<B: Kernels + HostNumbers, C: CheckpointStrategy> Kernels for Autodiff<B, C> {
    fn kernel_tanh(x: FloatTensor<Self>) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        let y = B::kernel_tanh(x);
        match Tanh.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(y.clone(), y),
            OpsKind::UnTracked(prep) => prep.finish(y),
        }
    }

    fn kernel_log_softmax(x: FloatTensor<Self>) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        let y = B::kernel_log_softmax(x);
        match LogSoftmax.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(y.clone(), y),
            OpsKind::UnTracked(prep) => prep.finish(y),
        }
    }

    fn kernel_gru(
        x: FloatTensor<Self>,
        weight_ih: FloatTensor<Self>,
        weight_hh: FloatTensor<Self>,
        bias_ih: FloatTensor<Self>,
        bias_hh: FloatTensor<Self>,
        initial: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let parts = [x, weight_ih, weight_hh, bias_ih, bias_hh, initial].map(|tensor| tensor.into_parts());
        let [(x, n0), (weight_ih, n1), (weight_hh, n2), (bias_ih, n3), (bias_hh, n4), (initial, n5)] = parts;
        let (output, scan) = scanned::<B>(&x, [&weight_ih, &weight_hh], [&bias_ih, &bias_hh], &initial);
        match GruScan.prepare::<C>([n0, n1, n2, n3, n4, n5]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((Arc::new(scan), x, weight_ih, weight_hh), output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    }
}

/// Does the forward pass of a recurrent layer.
fn scanned<B: HostNumbers>(
    x: &FloatTensor<B>,
    [weight_ih, weight_hh]: [&FloatTensor<B>; 2],
    [bias_ih, bias_hh]: [&FloatTensor<B>; 2],
    initial: &FloatTensor<B>,
) -> (FloatTensor<B>, ScanRecord) {
    let [directions, batch, hidden] = initial.shape().dims();
    let [rows, inputs] = x.shape().dims();
    let sizes = Sizes { steps: rows / batch.max(1), batch, inputs, hidden, directions };
    let [x_numbers, weight_ih, weight_hh] = [x, weight_ih, weight_hh].map(B::numbers);
    let [bias_ih, bias_hh, initial] = [bias_ih, bias_hh, initial].map(B::numbers);
    let input = ScanInput { x: &x_numbers, weight_ih: &weight_ih, weight_hh: &weight_hh };
    let (output, scan) = gru_scan::forward(input, (&bias_ih, &bias_hh), &initial, sizes);
    (tensor::<B>(output, [rows, directions * hidden], &x.device()), scan)
}

#[derive(Debug)]
struct Tanh;

impl<B: Kernels> Backward<B, 1> for Tanh {
    type State = FloatTensor<B>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let y = data::<B>(ops.state);
        unary::<B, _>(ops.parents, ops.node, grads, |grad| {
            edited::<B>(grad, |grad| elementwise::tanh_backward(grad, y.as_slice().expect("tensors are made of f32")))
        });
    }
}

#[derive(Debug)]
struct LogSoftmax;

impl<B: Kernels + HostNumbers> Backward<B, 1> for LogSoftmax {
    type State = FloatTensor<B>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let y = ops.state;
        let choices = y.shape()[1];
        unary::<B, _>(ops.parents, ops.node, grads, |grad| {
            edited::<B>(grad, |grad| log_softmax_backward(grad, &B::numbers(&y), choices))
        });
    }
}

#[derive(Debug)]
struct GruScan;

impl<B: Kernels + HostNumbers> Backward<B, 6> for GruScan {
    /// The intermediate results of the forward pass, x, W_ih and W_hh.
    type State = (Arc<ScanRecord>, FloatTensor<B>, FloatTensor<B>, FloatTensor<B>);

    fn backward(self, ops: Ops<Self::State, 6>, grads: &mut Gradients, _: &mut Checkpointer) {
        let output = grads.consume::<B>(&ops.node);
        let (scan, x, weight_ih, weight_hh) = ops.state;
        let Sizes { steps, batch, inputs, hidden, directions } = scan.sizes;
        let (rows, gates, device) = (steps * batch, 3 * hidden, output.device());
        let wanted = Wanted { x: ops.parents[0].is_some(), initial: ops.parents[5].is_some() };
        let numbers = [&x, &weight_ih, &weight_hh].map(B::numbers);
        let input = ScanInput { x: &numbers[0], weight_ih: &numbers[1], weight_hh: &numbers[2] };
        let found = gru_scan::backward(&B::numbers(&output), input, &scan, wanted);
        let ScanGrads { x, weight_ih, weight_hh, bias_ih, bias_hh, initial } = found;
        let shaped: [(Vec<f32>, Shape); 6] = [
            (x, [rows, inputs].into()),
            (weight_ih, [directions, inputs, gates].into()),
            (weight_hh, [directions, hidden, gates].into()),
            (bias_ih, [directions, gates].into()),
            (bias_hh, [directions, gates].into()),
            (initial, [directions, batch, hidden].into()),
        ];
        for (node, (values, shape)) in ops.parents.into_iter().zip(shaped) {
            if let Some(node) = node {
                grads.register::<B>(node.id, tensor::<B>(values, shape, &device));
            }
        }
    }
}

/// Returns the tensor after `edit`; copies only if it is shared.
fn edited<B: Backend>(tensor: FloatTensor<B>, edit: impl FnOnce(&mut [f32])) -> FloatTensor<B> {
    let device = tensor.device();
    let mut data = data::<B>(tensor);
    edit(data.as_mut_slice().expect("tensors are made of f32"));
    B::float_from_data(data, &device)
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_learner::DeviceKind;
    use playbot_learner::nn::{host, vector};

    #[test]
    fn tanh_and_its_gradient_agree_with_tensor_operations() {
        let x: Vec<f32> = (-400..=400).map(|i| i as f32 / 40.0).collect();
        for kind in DeviceKind::CPU {
            let both = |function: fn(Tensor<1>) -> Tensor<1>| {
                let x = vector(x.clone(), &kind.plain()).autodiff().require_grad();
                let y = function(x.clone());
                // Twice, so that gradients of two uses are added up.
                let grads = (y.clone() * 2.0 + y.clone().square()).sum().backward();
                [y.inner(), x.grad(&grads).expect("tracked")].map(|tensor| host(tensor).expect("readable"))
            };
            let want = both(|x| x.tanh());
            let got = both(|x| Activation::Tanh.forward(x));
            for (want, got) in want.iter().flatten().zip(got.iter().flatten()) {
                assert!((want - got).abs() <= 1e-6, "{got} is not {want} on {kind}");
            }
            let nan = host(Activation::Tanh.forward(vector(vec![f32::NAN], &kind.plain()))).expect("readable");
            assert!(nan[0].is_nan());
        }
    }
}

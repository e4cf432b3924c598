//! Operations on tensors for the backends whose numbers are in host memory: tanh, exp, logarithms, log-softmax and
//! recurrent layers.
//!
//! Each has its backward pass beside it and enters the gradient graph as one node. Devices without a kernel (see
//! [`is_host`]) use plain tensor operations instead. burn's own exp and logarithms are those of the system, whose last bits
//! depend on the processor.

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

/// Returns tanh of every element.
pub fn tanh<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    Function::Tanh.of(x)
}

/// Returns exp of every element.
pub fn exp<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    Function::Exp.of(x)
}

/// Returns the natural logarithm of every element.
pub fn ln<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    Function::Ln.of(x)
}

/// Returns ln(1 + x) of every element, without loss of digits near 0.
pub fn ln_1p<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    Function::Ln1p.of(x)
}

/// A function of single numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Function {
    Tanh,
    Exp,
    Ln,
    Ln1p,
}

impl Function {
    fn of<const D: usize>(self, x: Tensor<D>) -> Tensor<D> {
        if is_host(&x.device()) {
            return Tensor::from_dispatch(Dispatch::kernel_function(x.into_dispatch(), self));
        }
        match self {
            Self::Tanh => x.tanh(),
            Self::Exp => x.exp(),
            Self::Ln => x.log(),
            Self::Ln1p => x.log1p(),
        }
    }

    fn apply(self, values: &mut [f32]) {
        match self {
            Self::Tanh => elementwise::tanh_in_place(values),
            Self::Exp => values.iter_mut().for_each(|x| *x = libm::expf(*x)),
            Self::Ln => values.iter_mut().for_each(|x| *x = libm::logf(*x)),
            Self::Ln1p => values.iter_mut().for_each(|x| *x = libm::log1pf(*x)),
        }
    }

    /// Converts the gradient by the results to that by the elements; `kept` are the results of tanh and exp, and the
    /// elements of logarithms.
    fn backward(self, grad: &mut [f32], kept: &[f32]) {
        let pairs = grad.iter_mut().zip(kept);
        match self {
            Self::Tanh => elementwise::tanh_backward(grad, kept),
            Self::Exp => pairs.for_each(|(grad, y)| *grad *= y),
            Self::Ln => pairs.for_each(|(grad, x)| *grad /= x),
            Self::Ln1p => pairs.for_each(|(grad, x)| *grad /= 1.0 + x),
        }
    }
}

impl Activation {
    /// Applies the function to every element.
    pub fn forward<const D: usize>(self, x: Tensor<D>) -> Tensor<D> {
        match self {
            Self::Relu => activation::relu(x),
            Self::Tanh => tanh(x),
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
    /// Returns the function of every element.
    fn kernel_function(x: FloatTensor<Self>, function: Function) -> FloatTensor<Self>;

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
            fn kernel_function(x: FloatTensor<Self>, function: Function) -> FloatTensor<Self> {
                edited::<Self>(x, |x| function.apply(x))
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
    fn kernel_function(x: FloatTensor<Self>, function: Function) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        match OfNumbers.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let y = B::kernel_function(x.clone(), function);
                let kept = if matches!(function, Function::Tanh | Function::Exp) { y.clone() } else { x };
                prep.finish((kept, function), y)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::kernel_function(x, function)),
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
struct OfNumbers;

impl<B: Kernels> Backward<B, 1> for OfNumbers {
    /// What [`Function::backward`] needs.
    type State = (FloatTensor<B>, Function);

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (kept, function) = ops.state;
        let kept = data::<B>(kept);
        unary::<B, _>(ops.parents, ops.node, grads, |grad| {
            edited::<B>(grad, |grad| function.backward(grad, kept.as_slice().expect("tensors are made of f32")))
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
    fn functions_and_their_gradients_agree_with_tensor_operations() {
        type OfTensor = fn(Tensor<1>) -> Tensor<1>;
        let functions: [(OfTensor, OfTensor, f32); 4] = [
            (|x| Activation::Tanh.forward(x), |x| x.tanh(), 0.0),
            (exp, |x| x.exp(), 0.0),
            (ln, |x| x.log(), 10.1),
            (ln_1p, |x| x.log1p(), 9.1),
        ];
        for (kind, (ours, burns, shift)) in DeviceKind::CPU.into_iter().flat_map(|kind| functions.map(|of| (kind, of)))
        {
            let x: Vec<f32> = (-400..=400).map(|i| i as f32 / 40.0 + shift).collect();
            let both = |function: OfTensor| {
                let x = vector(x.clone(), &kind.plain()).autodiff().require_grad();
                let y = function(x.clone());
                // Twice, so that gradients of two uses are added up.
                let grads = (y.clone() * 2.0 + y.clone().square()).sum().backward();
                [y.inner(), x.grad(&grads).expect("tracked")].map(|tensor| host(tensor).expect("readable"))
            };
            let (want, got) = (both(burns), both(ours));
            for (want, got) in want.iter().flatten().zip(got.iter().flatten()) {
                assert!((want - got).abs() <= 1e-6 * want.abs().max(1.0), "{got} is not {want} on {kind}");
            }
            let nan = host(Activation::Tanh.forward(vector(vec![f32::NAN], &kind.plain()))).expect("readable");
            assert!(nan[0].is_nan());
        }
    }
}

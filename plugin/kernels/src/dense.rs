//! Dense layers with their activations, one after the other, as one operation for the flex backend.
//!
//! burn writes a product's result, reads it to add the bias, and reads it again for the activation. Each of these is
//! a node of the gradient graph. Here a few rows at a time go through all layers while they are in the cache, and
//! back again; one node gives all gradients. Threads synchronise five times in total, however many layers there are,
//! so small networks can be shared, too.
//!
//! A row of the output does not depend on the rest of the batch. Every sum is made by one thread in a fixed order, so
//! nothing depends on the number of threads.
//!
//! The folder, in reading order:
//!
//! - `packed`: weights in the orders in which products read them.
//! - `param_grads`: gradients of weights and biases: sums over all rows.

mod packed;
mod param_grads;
#[cfg(test)]
mod tests;

use crate::{
    dense::{
        packed::block_of,
        param_grads::{ParamGrads, through_activation},
    },
    elementwise::{Activation, Store, Write, relu, tanh, vectorized},
    host_numbers::{HostNumbers, tensor},
    kept_memory::{KeptMemory, KeptWeights, share, share_each},
    tile::{LANES, Window, correlate},
};
use burn::{
    backend::{
        Autodiff, Backend, Dispatch, DispatchDevice, ExtensionType, Flex, TensorMetadata,
        autodiff::{
            checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
            grads::Gradients,
            ops::{Backward, Ops, OpsKind},
        },
        backend_extension,
        tensor::FloatTensor,
    },
    tensor::Tensor,
};
use std::{borrow::Cow, sync::Arc};

pub(crate) use crate::dense::{
    packed::{Matrix, Packed},
    param_grads::{LayerSums, SumGrads, param_grads},
};

/// A layer: the activation of x W + b, if there is one.
#[derive(Clone, Copy, Debug)]
pub struct Dense<'a> {
    /// W, `[inputs, outputs]`.
    pub weight: &'a Tensor<2>,
    /// b, `[outputs]`.
    pub bias: &'a Tensor<1>,
    /// Applied to every output; none for a linear layer.
    pub activation: Option<Activation>,
}

/// Applies the layers, one after the other: `[n, outputs of the last]` for x `[n, inputs]`. Returns `None` if this is
/// not on flex.
pub fn dense(x: &Tensor<2>, layers: &[Dense<'_>]) -> Option<Tensor<2>> {
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
enum Params<B: Backend> {
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
trait DenseLayers: Backend {
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
    let numbers = numbers::<B>(params);
    let layers = layers(&numbers, activations);
    let packed = match KeptWeights::are_here() {
        true => {
            let weights = params.iter().step_by(2).zip(&layers);
            weights.map(|(weights, layer)| KeptWeights::of::<B, _>(weights, || Packed::new(layer.matrix()))).collect()
        }
        false => {
            let matrices: Vec<_> = layers.iter().map(Layer::matrix).collect();
            Packed::all(&matrices).into_iter().map(Arc::new).collect::<Vec<_>>()
        }
    };
    let (hidden, y) = forward(&B::numbers(x), &layers, &packed);
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

// The forward pass of rows through layers.

/// Rows that a thread takes at a time.
const ROWS: usize = 32;

/// Largest number of layers of one operation.
const MOST_LAYERS: usize = 3;

/// The activation of x W + b.
#[derive(Clone, Copy, Debug)]
struct Layer<'a> {
    /// W, `[inputs, outputs]`.
    weights: &'a [f32],
    /// b, `[outputs]`; at least one.
    bias: &'a [f32],
    activation: Option<Activation>,
}

impl<'a> Layer<'a> {
    fn inputs(&self) -> usize {
        self.weights.len() / self.bias.len()
    }

    fn outputs(&self) -> usize {
        self.bias.len()
    }

    fn matrix(&self) -> Matrix<'a> {
        Matrix { numbers: self.weights, rows: self.inputs(), columns: self.outputs(), is_turned: false }
    }

    /// Returns the matrix from the gradient of the sums to that of the input.
    fn turned(&self) -> Matrix<'a> {
        Matrix { numbers: self.weights, rows: self.outputs(), columns: self.inputs(), is_turned: true }
    }
}

/// Returns the outputs of all layers but the last, and those of the last, for rows `[n, inputs]`. Needs at least one
/// layer; `packed` holds their weights.
fn forward(x: &[f32], layers: &[Layer<'_>], packed: &[Arc<Packed>]) -> (Vec<KeptMemory>, Vec<f32>) {
    let (inputs, last) = (layers[0].inputs(), &layers[layers.len() - 1]);
    let n = x.len() / inputs;
    let hidden = layers[..layers.len() - 1].iter().map(|layer| KeptMemory::take(n * layer.outputs()));
    let (mut hidden, mut out): (Vec<KeptMemory>, _) = (hidden.collect(), vec![0.0; n * last.outputs()]);
    let outputs = hidden.iter_mut().map(|hidden| &mut **hidden).chain([&mut *out]);
    let mut pieces = pieces(outputs.zip(layers.iter().map(Layer::outputs)), n);
    share_each(&mut pieces, n * products(layers), |piece, outputs| {
        let mut x = &x[piece * ROWS * inputs..];
        let mut stride = inputs;
        for ((layer, weights), out) in layers.iter().zip(packed).zip(outputs) {
            rows_product(out, weights.columns, x, stride, weights, layer.bias);
            match layer.activation {
                None => {}
                Some(Activation::Relu) => vectorized(|| out.iter_mut().for_each(|y| *y = relu(*y))),
                Some(Activation::Tanh) => vectorized(|| out.iter_mut().for_each(|y| *y = tanh(*y))),
            }
            (x, stride) = (out, weights.columns);
        }
    });
    drop(pieces);
    (hidden, out)
}

/// Returns the number of products for a row.
fn products(layers: &[Layer<'_>]) -> usize {
    layers.iter().map(|layer| layer.weights.len()).sum()
}

/// Splits lists of `n` rows into pieces of a few rows each. Each list has its own number of values per row.
fn pieces<'a>(numbers: impl Iterator<Item = (&'a mut [f32], usize)>, n: usize) -> Vec<[&'a mut [f32]; MOST_LAYERS]> {
    let mut chunks: Vec<_> = numbers.map(|(numbers, width)| numbers.chunks_mut(ROWS * width)).collect();
    let mut next = |place: usize| chunks.get_mut(place).and_then(Iterator::next).unwrap_or_default();
    (0..n.div_ceil(ROWS)).map(|_| std::array::from_fn(&mut next)).collect()
}

/// Writes x W + b, `[n, columns]`, to existing memory, overwriting all of it. The rows `[n, rows of W]` begin every
/// `stride` numbers of `x`. Without `bias` sums start from 0.
pub(crate) fn product_into(out: &mut [f32], x: &[f32], stride: usize, weights: &Packed, bias: &[f32]) {
    let columns = weights.columns;
    let products = out.len() * weights.rows;
    share(out, ROWS * columns, products, |piece, out| {
        rows_product(out, columns, &x[piece * ROWS * stride..], stride, weights, bias);
    });
}

/// Does [`product_into`] for at most [`ROWS`] rows, which begin every `out_stride` numbers of `out`.
fn rows_product(out: &mut [f32], out_stride: usize, x: &[f32], stride: usize, weights: &Packed, bias: &[f32]) {
    let starts: [usize; ROWS] = std::array::from_fn(|row| row * stride);
    let window = Window { count: 1, step: 0, len: weights.rows };
    correlate(
        x,
        &starts[..out.len() / out_stride],
        window,
        weights.lanes(),
        |block| block_of(bias, block),
        true,
        |row, block, sums| {
            let first = block * LANES;
            Write(&mut *out).store(row * out_stride + first, out_stride - first, sums);
        },
    );
}

// The backward pass: from the gradient of the last layer's output to those of all parameters and the input.

/// The requested gradients.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    /// False if the gradient of the input may stay empty, which saves a product.
    x: bool,
    /// False if the gradients of the parameters may stay empty.
    params: bool,
}

/// Returns the gradients of the input `[n, inputs]` and of each layer's parameters, for `grad`, the gradient of the
/// last layer's output.
///
/// `outputs` holds the outputs of all layers.
fn backward(
    grad: &[f32],
    x: &[f32],
    layers: &[Layer<'_>],
    outputs: &[&[f32]],
    wanted: Wanted,
) -> (Vec<f32>, Vec<ParamGrads>) {
    let n = x.len() / layers[0].inputs();
    let mut sums: Vec<SumGrads> = layers.iter().map(|layer| SumGrads::unwritten(n, layer.outputs())).collect();
    let mut of_x = if wanted.x { vec![0.0; x.len()] } else { Vec::new() };
    to_sums(grad, layers, outputs, &mut sums, &mut of_x);
    if !wanted.params {
        return (of_x, Vec::new());
    }
    let given = std::iter::once(x).chain(outputs.iter().copied());
    let of_layers = given.zip(layers).zip(&sums);
    let of_layers = of_layers.map(|((x, layer), sums)| LayerSums { x, inputs: layer.inputs(), sums });
    (of_x, param_grads(&of_layers.collect::<Vec<_>>()))
}

/// Computes the gradients of all layers' sums, and that of the input unless it is empty.
fn to_sums(grad: &[f32], layers: &[Layer<'_>], outputs: &[&[f32]], sums: &mut [SumGrads], of_x: &mut [f32]) {
    // The layers whose inputs have gradients; the first one only on request.
    let first = usize::from(of_x.is_empty());
    let turned = Packed::all(&layers.iter().skip(first).map(Layer::turned).collect::<Vec<_>>());
    let strides: Vec<usize> = sums.iter().map(SumGrads::stride).collect();
    let last = layers.len() - 1;
    let (inputs, width) = (layers[0].inputs(), layers[last].outputs());
    let n = grad.len() / width;
    let numbers = sums.iter_mut().map(SumGrads::values_mut).zip(strides.iter().copied());
    let mut x_rows = of_x.chunks_mut(ROWS * inputs);
    let rows = pieces(numbers, n).into_iter().map(|sums| (sums, x_rows.next().unwrap_or_default()));
    let mut rows: Vec<([&mut [f32]; MOST_LAYERS], &mut [f32])> = rows.collect();
    share_each(&mut rows, n * products(layers), |piece, (sums, of_x)| {
        let given = grad[piece * ROWS * width..].chunks_exact(width);
        for (to, grad) in sums[last].chunks_exact_mut(strides[last]).zip(given) {
            to[..width].copy_from_slice(grad);
        }
        for (place, layer) in layers.iter().enumerate().rev() {
            let (before, here) = sums.split_at_mut(place);
            let (sums, columns) = (&mut *here[0], layer.outputs());
            through_activation(sums, &outputs[place][piece * ROWS * columns..], columns, layer.activation);
            match before.last_mut() {
                Some(before) => {
                    rows_product(before, strides[place - 1], sums, strides[place], &turned[place - first], &[]);
                }
                None if first == 0 => rows_product(of_x, inputs, sums, strides[0], &turned[0], &[]),
                None => {}
            }
        }
    });
}

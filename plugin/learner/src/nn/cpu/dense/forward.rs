//! The forward pass of rows through layers.

use super::packed::{Matrix, Packed, block_of};
use crate::nn::Activation;
use crate::nn::cpu::fast_math::{tanh, vectorized};
use crate::nn::cpu::kept_memory::KeptMemory;
use crate::nn::cpu::relu::relu;
use crate::nn::cpu::share::{share, share_each};
use crate::nn::cpu::store::{Store, Write};
use crate::nn::cpu::tile::{LANES, Window, correlate};

/// Rows that a thread takes at a time.
pub(super) const ROWS: usize = 32;
/// Largest number of layers of one operation.
pub(super) const MOST_LAYERS: usize = 3;

/// The activation of x W + b.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer<'a> {
    /// W, `[inputs, outputs]`.
    pub(super) weights: &'a [f32],
    /// b, `[outputs]`; at least one.
    pub(super) bias: &'a [f32],
    pub(super) activation: Option<Activation>,
}

impl<'a> Layer<'a> {
    pub(super) fn inputs(&self) -> usize {
        self.weights.len() / self.bias.len()
    }

    pub(super) fn outputs(&self) -> usize {
        self.bias.len()
    }

    fn matrix(&self) -> Matrix<'a> {
        Matrix { numbers: self.weights, rows: self.inputs(), columns: self.outputs(), is_turned: false }
    }

    /// Returns the matrix from the gradient of the sums to that of the input.
    pub(super) fn turned(&self) -> Matrix<'a> {
        Matrix { numbers: self.weights, rows: self.outputs(), columns: self.inputs(), is_turned: true }
    }
}

/// Returns the outputs of all layers but the last, and those of the last, for rows `[n, inputs]`. Needs at least one
/// layer.
pub(super) fn forward(x: &[f32], layers: &[Layer<'_>]) -> (Vec<KeptMemory>, Vec<f32>) {
    let (inputs, last) = (layers[0].inputs(), &layers[layers.len() - 1]);
    let n = x.len() / inputs;
    let packed = Packed::all(&layers.iter().map(Layer::matrix).collect::<Vec<_>>());
    let hidden = layers[..layers.len() - 1].iter().map(|layer| KeptMemory::take(n * layer.outputs()));
    let (mut hidden, mut out): (Vec<KeptMemory>, _) = (hidden.collect(), vec![0.0; n * last.outputs()]);
    let outputs = hidden.iter_mut().map(|hidden| &mut **hidden).chain([&mut *out]);
    let mut pieces = pieces(outputs.zip(layers.iter().map(Layer::outputs)), n);
    share_each(&mut pieces, n * products(layers), |piece, outputs| {
        let mut x = &x[piece * ROWS * inputs..];
        let mut stride = inputs;
        for ((layer, weights), out) in layers.iter().zip(&packed).zip(outputs) {
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
pub(super) fn products(layers: &[Layer<'_>]) -> usize {
    layers.iter().map(|layer| layer.weights.len()).sum()
}

/// Splits lists of `n` rows into pieces of a few rows each. Each list has its own number of values per row.
pub(super) fn pieces<'a>(
    numbers: impl Iterator<Item = (&'a mut [f32], usize)>,
    n: usize,
) -> Vec<[&'a mut [f32]; MOST_LAYERS]> {
    let mut chunks: Vec<_> = numbers.map(|(numbers, width)| numbers.chunks_mut(ROWS * width)).collect();
    let mut next = |place: usize| chunks.get_mut(place).and_then(Iterator::next).unwrap_or_default();
    (0..n.div_ceil(ROWS)).map(|_| std::array::from_fn(&mut next)).collect()
}

/// Writes x W + b, `[n, columns]`, to existing memory, overwriting all of it. The rows `[n, rows of W]` begin every
/// `stride` numbers of `x`. Without `bias` sums start from 0.
pub(in crate::nn::cpu) fn product_into(out: &mut [f32], x: &[f32], stride: usize, weights: &Packed, bias: &[f32]) {
    let columns = weights.columns;
    let products = out.len() * weights.rows;
    share(out, ROWS * columns, products, |piece, out| {
        rows_product(out, columns, &x[piece * ROWS * stride..], stride, weights, bias);
    });
}

/// Does [`product_into`] for at most [`ROWS`] rows, which begin every `out_stride` numbers of `out`.
pub(super) fn rows_product(
    out: &mut [f32],
    out_stride: usize,
    x: &[f32],
    stride: usize,
    weights: &Packed,
    bias: &[f32],
) {
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

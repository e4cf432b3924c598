//! From the gradient of a layer's output to those of its parameters and its input.

use super::forward::product;
use super::packed::Packed;
use super::share::share;
use crate::nn::Activation;
use crate::nn::cpu::fast_math::vectorized;
use crate::nn::cpu::kept_memory::KeptMemory;
use crate::nn::cpu::outer::{column_sums, outer};
use crate::nn::cpu::relu::relu_backward;
use crate::nn::cpu::tile::{LANES, Lanes, WIDE_ROWS, Window};

/// Rows whose gradients a thread takes through the activation at a time.
const ROWS: usize = 64;

/// The gradient of x W + b: `[n, columns]`, its rows filled up with zeros to whole blocks of 16.
pub(in crate::nn::cpu) struct SumGrads {
    n: usize,
    columns: usize,
    stride: usize,
    values: KeptMemory,
}

impl SumGrads {
    /// From the gradient of the output `y`, which the activation gave.
    pub(in crate::nn::cpu) fn new(grad: &[f32], y: &[f32], columns: usize, activation: Option<Activation>) -> Self {
        let (n, stride) = (grad.len() / columns, columns.next_multiple_of(LANES));
        let mut values = KeptMemory::take(n * stride);
        // Each is little work.
        share(&mut values, ROWS * stride, grad.len(), |piece, values| {
            let first = piece * ROWS * columns;
            let given = grad[first..].chunks_exact(columns).zip(y[first..].chunks_exact(columns));
            let rows = values.chunks_exact_mut(stride).zip(given);
            vectorized(|| {
                for (to, (grad, y)) in rows {
                    to[columns..].fill(0.0);
                    let numbers = to.iter_mut().zip(grad.iter().zip(y));
                    match activation {
                        None => numbers.for_each(|(to, (&grad, _))| *to = grad),
                        Some(Activation::Relu) => {
                            numbers.for_each(|(to, (&grad, &y))| *to = relu_backward(y, grad));
                        }
                        Some(Activation::Tanh) => numbers.for_each(|(to, (&grad, &y))| *to = grad * (1.0 - y * y)),
                    }
                }
            });
        });
        Self { n, columns, stride, values }
    }

    /// The gradient of the input: `[n, inputs]`, for weights `[inputs, columns]`.
    pub(in crate::nn::cpu) fn input(&self, weights: &[f32]) -> Vec<f32> {
        let turned = Packed::transposed(weights, self.columns, weights.len() / self.columns);
        product(&self.values, (self.n, self.stride), &turned, &[], None)
    }

    /// The gradients of weights `[inputs, columns]` and biases, for the input `[n, inputs]`.
    pub(in crate::nn::cpu) fn params(&self, x: &[f32], inputs: usize) -> (Vec<f32>, Vec<f32>) {
        let blocks = self.stride / LANES;
        let mut memory = KeptMemory::zeros(blocks * inputs * LANES);
        let sums: &mut [Lanes] = memory.as_chunks_mut().0;
        let mut biases = vec![[0.0; LANES]; blocks];
        let places: Vec<usize> = (0..self.n).map(|row| row * self.stride).collect();
        let products = self.n * inputs * self.columns;
        column_sums(&self.values, &places, &mut biases);
        share(sums, 2 * inputs, products, |pair, sums| {
            self.add_products(x, inputs, &self.values[2 * pair * LANES..], &places, sums);
        });
        let mut weights = vec![0.0; inputs * self.columns];
        share(&mut weights, self.columns * ROWS, inputs * self.columns, |piece, weights| {
            for (row, weights) in (piece * ROWS..).zip(weights.chunks_exact_mut(self.columns)) {
                let (whole, rest) = weights.as_chunks_mut::<LANES>();
                whole.iter_mut().enumerate().for_each(|(block, to)| *to = sums[block * inputs + row]);
                if !rest.is_empty() {
                    rest.copy_from_slice(&sums[whole.len() * inputs + row][..rest.len()]);
                }
            }
        });
        let mut bias = biases.into_flattened();
        bias.truncate(self.columns);
        (weights, bias)
    }

    /// Adds the products of inputs and gradients to those of two blocks.
    fn add_products(&self, x: &[f32], inputs: usize, y: &[f32], places: &[usize], sums: &mut [Lanes]) {
        let window = Window { count: 1, step: 0, len: inputs };
        let starts: Vec<usize> = (0..self.n).map(|row| row * inputs).collect();
        // A few numbers beyond a row are read and not used. The last rows have none behind them.
        let few = WIDE_ROWS.div_ceil(inputs).min(self.n);
        let (places, last) = places.split_at(self.n - few);
        outer(x, &starts[..places.len()], window, y, places, sums);
        let mut end = x[places.len() * inputs..].to_vec();
        end.resize(end.len() + WIDE_ROWS, 0.0);
        outer(&end, &starts[..few], window, y, last, sums);
    }
}

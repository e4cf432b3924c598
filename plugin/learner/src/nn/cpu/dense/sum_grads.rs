//! Gradients of sums, laid out for products.

use crate::nn::Activation;
use crate::nn::cpu::fast_math::vectorized;
use crate::nn::cpu::kept_memory::KeptMemory;
use crate::nn::cpu::relu::relu_backward;
use crate::nn::cpu::tile::LANES;

/// The gradient of x W + b: `[n, columns]`, its rows filled up to whole blocks of 16.
#[derive(Debug)]
pub(in crate::nn::cpu) struct SumGrads {
    pub(super) columns: usize,
    values: KeptMemory,
}

impl SumGrads {
    /// Allocates numbers that are yet to be written.
    pub(in crate::nn::cpu) fn unwritten(n: usize, columns: usize) -> Self {
        Self { columns, values: KeptMemory::take(n * stride(columns)) }
    }

    /// Returns the distance from one row to the next.
    pub(in crate::nn::cpu) fn stride(&self) -> usize {
        stride(self.columns)
    }

    /// Returns all rows.
    pub(in crate::nn::cpu) fn values(&self) -> &[f32] {
        &self.values
    }

    /// Returns all rows, to be written; their padding does not matter.
    pub(in crate::nn::cpu) fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }
}

/// Returns the distance from one row to the next, for this many columns.
fn stride(columns: usize) -> usize {
    columns.next_multiple_of(LANES)
}

/// Converts rows of a gradient of outputs, in the layout of [`SumGrads`], to that of the sums; `y` is the
/// activation's output, `[n, columns]`.
pub(super) fn through_activation(sums: &mut [f32], y: &[f32], columns: usize, activation: Option<Activation>) {
    let rows = sums.chunks_exact_mut(stride(columns)).zip(y.chunks_exact(columns));
    match activation {
        None => {}
        Some(Activation::Relu) => vectorized(|| {
            for (grad, y) in rows {
                grad.iter_mut().zip(y).for_each(|(grad, &y)| *grad = relu_backward(y, *grad));
            }
        }),
        Some(Activation::Tanh) => vectorized(|| {
            for (grad, y) in rows {
                grad.iter_mut().zip(y).for_each(|(grad, &y)| *grad *= 1.0 - y * y);
            }
        }),
    }
}

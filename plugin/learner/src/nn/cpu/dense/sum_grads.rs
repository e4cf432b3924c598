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
    /// Numbers that are yet to be written.
    pub(in crate::nn::cpu) fn unwritten(n: usize, columns: usize) -> Self {
        Self { columns, values: KeptMemory::take(n * stride(columns)) }
    }

    /// From one row to the next.
    pub(in crate::nn::cpu) fn stride(&self) -> usize {
        stride(self.columns)
    }

    /// All rows.
    pub(in crate::nn::cpu) fn values(&self) -> &[f32] {
        &self.values
    }

    /// All rows, to be written; what fills them up does not matter.
    pub(in crate::nn::cpu) fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }
}

/// From one row to the next, for so many columns.
fn stride(columns: usize) -> usize {
    columns.next_multiple_of(LANES)
}

/// Takes rows of a gradient of outputs, in the layout of [`SumGrads`], to that of the sums; `y` is what the activation gave,
/// `[n, columns]`.
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

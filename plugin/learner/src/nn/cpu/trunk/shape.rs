//! Sizes of a convolution, and the orders of its weights.

use crate::nn::cpu::tile::LANES;

/// Returns the number of positions of a kernel or pooling window along a side of `size` pixels; `None` if it does not
/// fit.
pub fn window_places(size: usize, kernel: usize, stride: usize, padding: usize) -> Option<usize> {
    let room = size.saturating_add(2 * padding).checked_sub(kernel)?;
    Some(room / stride + 1)
}

/// Sizes of a convolution with a square kernel.
#[derive(Clone, Copy, Debug)]
pub(super) struct ConvShape {
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    pub(super) kernel: usize,
    pub(super) stride: usize,
    pub(super) padding: usize,
}

impl ConvShape {
    /// Returns the number of weights and biases.
    pub(super) fn params(self) -> usize {
        self.outputs * (self.inputs * self.kernel * self.kernel + 1)
    }

    /// Returns whether the output is as large as the input: the gradient of the input is then a convolution, too.
    pub(super) fn same(self) -> bool {
        self.stride == 1 && 2 * self.padding + 1 == self.kernel
    }

    /// Visits each weight's number and position, in the order `[outputs, inputs, kernel, kernel]`.
    pub(super) fn each_weight(self, mut visit: impl FnMut(usize, Place)) {
        let side = self.kernel;
        let mut number = 0;
        for o in 0..self.outputs {
            for i in 0..self.inputs {
                for y in 0..side {
                    for x in 0..side {
                        visit(number, Place { o, i, y, x });
                        number += 1;
                    }
                }
            }
        }
    }

    /// Returns row and lane of a weight in the order for [`correlate`](crate::nn::cpu::tile::correlate).
    pub(super) fn forward_at(self, Place { o, i, y, x }: Place) -> (usize, usize) {
        let rows = self.kernel * self.kernel * self.inputs;
        (o / LANES * rows + (y * self.kernel + x) * self.inputs + i, o % LANES)
    }

    /// Returns the rows in the order for [`correlate`](crate::nn::cpu::tile::correlate).
    pub(super) fn forward_rows(self) -> usize {
        self.outputs.div_ceil(LANES) * self.kernel * self.kernel * self.inputs
    }

    /// Returns row and lane of a weight in the order for the gradient of the input.
    pub(super) fn backward_at(self, Place { o, i, y, x }: Place) -> (usize, usize) {
        if self.same() {
            let rows = self.kernel * self.kernel * self.outputs;
            let turned = (self.kernel - 1 - y) * self.kernel + self.kernel - 1 - x;
            (i / LANES * rows + turned * self.outputs + o, i % LANES)
        } else {
            let (tiles, at) = ((self.kernel * self.inputs).div_ceil(LANES), x * self.inputs + i);
            ((y * tiles + at / LANES) * self.outputs + o, at % LANES)
        }
    }

    /// Returns the rows in the order for the gradient of the input.
    pub(super) fn backward_rows(self) -> usize {
        if self.same() {
            self.inputs.div_ceil(LANES) * self.kernel * self.kernel * self.outputs
        } else {
            (self.kernel * self.inputs).div_ceil(LANES) * self.kernel * self.outputs
        }
    }
}

/// A weight's output and input channel, row and column.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) o: usize,
    pub(super) i: usize,
    pub(super) y: usize,
    pub(super) x: usize,
}

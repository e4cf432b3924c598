//! Sizes of a convolution, and the orders in which its weights lie.

use crate::nn::cpu::tile::LANES;

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
    /// Weights and biases.
    pub(super) fn params(self) -> usize {
        self.outputs * (self.inputs * self.kernel * self.kernel + 1)
    }

    /// Whether the output is as large as the input: the gradient of the input is then a convolution of its own.
    pub(super) fn same(self) -> bool {
        self.stride == 1 && 2 * self.padding + 1 == self.kernel
    }

    /// Shows each weight's number and place, in the order `[outputs, inputs, kernel, kernel]`.
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

    /// Row and lane of a weight in the order for [`correlate`](crate::nn::cpu::tile::correlate).
    pub(super) fn forward_at(self, Place { o, i, y, x }: Place) -> (usize, usize) {
        let rows = self.kernel * self.kernel * self.inputs;
        (o / LANES * rows + (y * self.kernel + x) * self.inputs + i, o % LANES)
    }

    /// Rows in the order for [`correlate`](crate::nn::cpu::tile::correlate).
    pub(super) fn forward_rows(self) -> usize {
        self.outputs.div_ceil(LANES) * self.kernel * self.kernel * self.inputs
    }

    /// Row and lane of a weight in the order for the gradient of the input.
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

    /// Rows in the order for the gradient of the input.
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

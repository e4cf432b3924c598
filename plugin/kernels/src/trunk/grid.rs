//! The layout of one image's pixels in memory, and max-pooling between two of them.

use crate::{
    instructions::macerator::{self, Simd},
    tile::{LANES, Lanes, lanes_at},
};
use std::ops::Range;

/// Unused numbers after the last one of every image: vectors and tiles may read, but never use, numbers behind a row.
const SLACK: usize = 16;

/// An image with its channels last, in a border of zeros.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Grid {
    pub(super) channels: usize,
    pub(super) height: usize,
    pub(super) width: usize,
    pub(super) border: usize,
}

impl Grid {
    /// Numbers from one row to the next.
    pub(super) fn row(self) -> usize {
        (self.width + 2 * self.border) * self.channels
    }

    /// Returns the numbers of the image with its border and the readable numbers behind it.
    pub(super) fn len(self) -> usize {
        (self.height + 2 * self.border) * self.row() + SLACK
    }

    /// Numbers without the border.
    pub(super) fn numbers(self) -> usize {
        self.channels * self.height * self.width
    }

    /// Returns the position at which a pixel begins.
    pub(super) fn at(self, y: usize, x: usize) -> usize {
        (y + self.border) * self.row() + (x + self.border) * self.channels
    }

    /// Returns the position at which each pixel begins, row by row.
    pub(super) fn places(self) -> Vec<usize> {
        (0..self.height).flat_map(|y| (0..self.width).map(move |x| self.at(y, x))).collect()
    }

    /// Writes zeros into the border, and behind the image.
    pub(super) fn clear_border(self, values: &mut [f32]) {
        let (side, row) = (self.border * self.channels, self.row());
        let inside = self.border * row..(self.border + self.height) * row;
        values[..inside.start].fill(0.0);
        values[inside.end..self.len()].fill(0.0);
        for row in values[inside].chunks_exact_mut(row.max(1)) {
            row[..side].fill(0.0);
            row[side + self.width * self.channels..].fill(0.0);
        }
    }

    /// Returns the rows without the border.
    pub(super) fn rows(self, values: &[f32]) -> impl Iterator<Item = &[f32]> {
        (0..self.height).map(move |y| &values[self.at(y, 0)..][..self.width * self.channels])
    }

    /// Returns the rows without the border.
    pub(super) fn rows_mut(self, values: &mut [f32]) -> impl Iterator<Item = &mut [f32]> {
        let from = self.border * (self.row() + self.channels);
        let rows = values[from..].chunks_mut(self.row().max(1)).take(self.height);
        rows.map(move |row| &mut row[..self.width * self.channels])
    }

    /// Reads an image `[channels, height, width]`; the border is unchanged.
    pub(super) fn read(self, image: &[f32], values: &mut [f32]) {
        for (y, row) in self.rows_mut(values).enumerate() {
            for c in 0..self.channels {
                let from = &image[(c * self.height + y) * self.width..][..self.width];
                row.iter_mut().skip(c).step_by(self.channels).zip(from).for_each(|(to, from)| *to = *from);
            }
        }
    }

    /// Writes the image as `[channels, height, width]`, each number after `change`.
    pub(super) fn write(self, values: &[f32], image: &mut [f32], change: impl Fn(f32) -> f32) {
        for (y, row) in self.rows(values).enumerate() {
            for c in 0..self.channels {
                let to = &mut image[(c * self.height + y) * self.width..][..self.width];
                to.iter_mut().zip(row.iter().skip(c).step_by(self.channels)).for_each(|(to, from)| *to = change(*from));
            }
        }
    }
}

// Sizes of a convolution, and the orders of its weights.

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
    pub(super) fn each_weight(self, mut visit: impl FnMut(usize, KernelIndex)) {
        let side = self.kernel;
        let mut number = 0;
        for o in 0..self.outputs {
            for i in 0..self.inputs {
                for y in 0..side {
                    for x in 0..side {
                        visit(number, KernelIndex { o, i, y, x });
                        number += 1;
                    }
                }
            }
        }
    }

    /// Returns row and lane of a weight in the order for [`correlate`](crate::tile::correlate).
    pub(super) fn forward_at(self, KernelIndex { o, i, y, x }: KernelIndex) -> (usize, usize) {
        let rows = self.kernel * self.kernel * self.inputs;
        (o / LANES * rows + (y * self.kernel + x) * self.inputs + i, o % LANES)
    }

    /// Returns the rows in the order for [`correlate`](crate::tile::correlate).
    pub(super) fn forward_rows(self) -> usize {
        self.outputs.div_ceil(LANES) * self.kernel * self.kernel * self.inputs
    }

    /// Returns row and lane of a weight in the order for the gradient of the input.
    pub(super) fn backward_at(self, KernelIndex { o, i, y, x }: KernelIndex) -> (usize, usize) {
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
pub(super) struct KernelIndex {
    pub(super) o: usize,
    pub(super) i: usize,
    pub(super) y: usize,
    pub(super) x: usize,
}

// Max-pooling of 3×3 pixels, at every second pixel, from one grid to another.

/// Side of the window.
const SIDE: usize = 3;

/// Returns the side of the pooled image.
pub(super) fn pooled(side: usize) -> usize {
    window_places(side, SIDE, 2, 1).unwrap_or(0)
}

/// Returns the rows or columns of a window that are inside an image of `side`: numbers in the window, from the one at
/// `start`.
#[inline(always)]
fn inside(place: usize, side: usize) -> Range<usize> {
    let first = usize::from(place == 0);
    first..SIDE.min(side + 1 - 2 * place)
}

/// Pools `x`; `marks` gets, for each channel of each pixel, the index of the (first) largest of the nine.
#[macerator::with_simd]
#[allow(clippy::extra_unused_type_parameters, reason = "S says which instructions the loop is compiled for")]
pub(super) fn pool<S: Simd>(x: &[f32], from: Grid, y: &mut [f32], to: Grid, marks: &mut [u8]) {
    {
        let channels = from.channels;
        for row in 0..to.height {
            for column in 0..to.width {
                let marks = &mut marks[(row * to.width + column) * channels..][..channels];
                let y = &mut y[to.at(row, column)..][..channels];
                let parts = y.chunks_mut(LANES).zip(marks.chunks_mut(LANES)).enumerate();
                for (block, (y, marks)) in parts {
                    let (best, which) = largest(&x[block * LANES..], from, row, column);
                    y.iter_mut().zip(&best).for_each(|(y, best)| *y = *best);
                    marks.iter_mut().zip(&which).for_each(|(mark, which)| *mark = *which as u8);
                }
            }
        }
    }
}

#[inline(always)]
fn largest(x: &[f32], from: Grid, row: usize, column: usize) -> (Lanes, [u32; LANES]) {
    let (rows, columns) = (inside(row, from.height), inside(column, from.width));
    let mut best = [f32::NEG_INFINITY; LANES];
    let mut which = [(rows.start * SIDE + columns.start) as u32; LANES];
    for dy in rows {
        for dx in columns.clone() {
            // The border is part of the row: the window's corner is one pixel up and left.
            let at =
                (2 * row + dy + from.border - 1) * from.row() + (2 * column + dx + from.border - 1) * from.channels;
            let x = lanes_at(x, at);
            let number = (dy * SIDE + dx) as u32;
            for j in 0..LANES {
                // NaN wins, so that it is not hidden.
                let wins = x[j] > best[j] || x[j].is_nan();
                best[j] = if wins { x[j] } else { best[j] };
                which[j] = if wins { number } else { which[j] };
            }
        }
    }
    (best, which)
}

/// Computes the gradient of the pooled image's input; writes all of `to` inside the border.
pub(super) fn pool_backward(grad: &[f32], of: Grid, marks: &[u8], to: &mut [f32], grid: Grid) {
    to.fill(0.0);
    let channels = grid.channels;
    let offsets: [usize; SIDE * SIDE] = std::array::from_fn(|tap| tap / SIDE * grid.row() + tap % SIDE * channels);
    for row in 0..of.height {
        for column in 0..of.width {
            let corner = (2 * row + grid.border - 1) * grid.row() + (2 * column + grid.border - 1) * channels;
            let grad = &grad[of.at(row, column)..][..channels];
            let marks = &marks[(row * of.width + column) * channels..][..channels];
            for (c, (grad, &mark)) in grad.iter().zip(marks).enumerate() {
                to[corner + offsets[usize::from(mark) % (SIDE * SIDE)] + c] += grad;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_comes_back_and_its_border_stays() {
        let grid = Grid { channels: 2, height: 3, width: 4, border: 1 };
        let image: Vec<f32> = (1..=24).map(|i| i as f32).collect();
        let mut values = vec![0.0; grid.len()];
        grid.read(&image, &mut values);
        assert_eq!(values.iter().sum::<f32>(), 300.0);
        // The second channel of the pixel in row 1, column 2.
        assert_eq!(values[grid.at(1, 2) + 1], 19.0);
        let mut dirty = vec![7.0; grid.len()];
        grid.clear_border(&mut dirty);
        grid.read(&image, &mut dirty);
        assert_eq!(dirty, values, "whatever was there before");
        let inside: f32 = grid.places().iter().map(|&at| values[at] + values[at + 1]).sum();
        assert_eq!(inside, 300.0);
        let mut back = vec![0.0; 24];
        grid.write(&values, &mut back, |x| x);
        assert_eq!(back, image);
    }
}

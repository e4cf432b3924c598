//! 3×3 convolutions with 2.25 times fewer products: Winograd's F(2×2, 3×3) (Lavin and Gray 2016, "Fast algorithms for
//! convolutional neural networks").
//!
//! The 4×4 input pixels d of 2×2 output pixels, and the 3×3 weights g, become 4×4 points each. The output is Aᵀ[Σ (G g
//! Gᵀ) ⊙ (Bᵀ d B)]A, where the sum over the input channels makes a product of matrices for each point. The gradient of
//! the input is such a convolution again. That of the weights is Gᵀ[Σ (Bᵀ d B) ⊙ (A y Aᵀ)]G for the gradient y of the
//! output.

use crate::{
    elementwise::Store,
    instructions::macerator::{self, Simd},
    tile::{LANES, Lanes, lanes_at},
    trunk::{
        grid::{ConvShape, Grid, KernelIndex},
        products::{Matrices, add_products, products},
    },
};
use std::ops::Range;

/// G, which converts weights to points.
const G: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.5, 0.5, 0.5], [0.5, -0.5, 0.5], [0.0, 0.0, 1.0]];

/// Returns whether the method applies to a convolution of images of this size.
pub(super) fn fits(shape: ConvShape, height: usize, width: usize) -> bool {
    let is_even = height.is_multiple_of(2) && width.is_multiple_of(2);
    let has_blocks = shape.inputs.is_multiple_of(LANES) && shape.outputs.is_multiple_of(LANES);
    shape.same() && shape.kernel == 3 && is_even && has_blocks
}

/// Returns the rows of the points for this many inputs and outputs.
pub(super) fn rows(inputs: usize, outputs: usize) -> usize {
    POINTS * inputs * outputs / LANES
}

/// Returns G g Gᵀ of all weights of a shape, which lie in the order `[outputs, inputs, 3, 3]`: point by point, for
/// each block of 16 outputs, the inputs. `turned` exchanges inputs and outputs and rotates the kernel, for the
/// gradient of the input.
pub(super) fn points(shape: ConvShape, weights: &[f32], turned: bool) -> Vec<Lanes> {
    let (inputs, outputs) = if turned { (shape.outputs, shape.inputs) } else { (shape.inputs, shape.outputs) };
    let mut points = vec![[0.0; LANES]; rows(inputs, outputs)];
    for (number, kernel) in weights.as_chunks::<9>().0.iter().enumerate() {
        let (o, i) = (number / shape.inputs, number % shape.inputs);
        let (from, to) = if turned { (o, i) } else { (i, o) };
        let weight = |y: usize, x: usize| f64::from(kernel[if turned { 8 - (3 * y + x) } else { 3 * y + x }]);
        for (point, rows) in points.chunks_exact_mut(inputs * outputs / LANES).enumerate() {
            let (left, right) = (G[point / 4], G[point % 4]);
            let row = |y: usize| (0..3).map(|x| weight(y, x) * right[x]).sum::<f64>();
            rows[to / LANES * inputs + from][to % LANES] = (0..3).map(|y| left[y] * row(y)).sum::<f64>() as f32;
        }
    }
    points
}

/// Returns the gradient of a weight from sums of [`add_gradients`]: Gᵀ S G at its position in the kernel.
pub(super) fn gradient(shape: ConvShape, sums: &[Lanes], place: KernelIndex) -> f32 {
    let KernelIndex { o, i, y, x } = place;
    let rows = shape.inputs * shape.outputs / LANES;
    let at = |point: usize| f64::from(sums[point * rows + o / LANES * shape.inputs + i][o % LANES]);
    let row = |a: usize| (0..4).map(|b| at(4 * a + b) * G[b][x]).sum::<f64>();
    (0..4).map(|a| G[a][y] * row(a)).sum::<f64>() as f32
}

/// Memory for the points of an image before and after a product.
#[derive(Debug, Default)]
pub(super) struct PointBuffers {
    before: Vec<f32>,
    after: Vec<f32>,
}

impl PointBuffers {
    /// Returns the needed first numbers of both.
    fn of(&mut self, before: usize, after: usize) -> (&mut [f32], &mut [f32]) {
        let grow = |buffer: &mut Vec<f32>, len: usize| buffer.resize(buffer.len().max(len), 0.0);
        grow(&mut self.before, before);
        grow(&mut self.after, after);
        (&mut self.before[..before], &mut self.after[..after])
    }
}

/// Computes the convolution of `x`, which lies in `from`, with these [`points`]: `store` gets the sums of products,
/// with the bias, by positions in `to`.
pub(super) fn convolve(
    x: &[f32],
    (from, to): (Grid, Grid),
    points: &[Lanes],
    bias: impl Fn(usize) -> Lanes,
    buffers: &mut PointBuffers,
    mut store: impl Store,
) {
    for strip in Strip::of(to, from.channels.max(to.channels)) {
        let (rows, sums) = (strip.matrices(from.channels), strip.matrices(to.channels));
        let (before, after) = buffers.of(POINTS * rows.step, POINTS * sums.step);
        transform_seen(x, from, strip, before);
        products(before, rows, points, after, sums);
        transform_back(after, to, strip, &bias, &mut store);
    }
}

/// Adds to `sums` the products of the points of `x` and of `grad`, the gradient of the output.
pub(super) fn add_gradients(
    x: &[f32],
    grad: &[f32],
    (from, to): (Grid, Grid),
    buffers: &mut PointBuffers,
    sums: &mut [Lanes],
) {
    for strip in Strip::of(to, from.channels.max(to.channels)) {
        let (rows, columns) = (strip.matrices(from.channels), strip.matrices(to.channels));
        let (seen, spread) = buffers.of(POINTS * rows.step, POINTS * columns.step);
        transform_seen(x, from, strip, seen);
        transform_gradient(grad, to, strip, spread);
        add_products(seen, rows, spread, columns, sums);
    }
}

// The transforms, of 16 channels at a time.

/// Numbers of a transformed tile: 4×4 points.
pub(super) const POINTS: usize = 16;

/// Side of a transformed tile.
const SIDE: usize = 4;

/// Some rows of the tiles of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strip {
    first: usize,
    count: usize,
    across: usize,
}

/// Approximate numbers of a point in a strip: the points of a strip stay in the cache.
const NUMBERS: usize = 1024;

impl Strip {
    /// Returns the strips of an image; all but the last have the same size. `channels` is the larger of the two
    /// numbers of channels.
    pub(super) fn of(grid: Grid, channels: usize) -> impl Iterator<Item = Self> {
        let (down, across) = (grid.height / 2, grid.width / 2);
        let most = (NUMBERS / (across * channels).max(1)).clamp(1, down.max(1));
        (0..down).step_by(most).map(move |first| Self { first, count: most.min(down - first), across })
    }

    /// Returns the layout of its points: a matrix for each point. It has one unneeded block, without which the points
    /// of a tile would share lines of the cache.
    pub(super) fn matrices(self, channels: usize) -> Matrices {
        let rows = self.count * self.across;
        Matrices { rows, columns: channels, step: rows * channels + LANES }
    }

    fn rows(self) -> Range<usize> {
        self.first..self.first + self.count
    }
}

#[inline(always)]
fn plus(one: &Lanes, other: &Lanes) -> Lanes {
    let mut to = [0.0; LANES];
    for l in 0..LANES {
        to[l] = one[l] + other[l];
    }
    to
}

#[inline(always)]
fn minus(one: &Lanes, other: &Lanes) -> Lanes {
    let mut to = [0.0; LANES];
    for l in 0..LANES {
        to[l] = one[l] - other[l];
    }
    to
}

/// Returns Bᵀd of a column: (d₀ − d₂, d₁ + d₂, d₂ − d₁, d₁ − d₃).
#[inline(always)]
fn seen([d0, d1, d2, d3]: [&Lanes; SIDE]) -> [Lanes; SIDE] {
    [minus(d0, d2), plus(d1, d2), minus(d2, d1), minus(d1, d3)]
}

/// Returns [`seen`] of the column of pixels below a position.
#[inline(always)]
fn column(x: &[f32], at: usize, row: usize) -> [Lanes; SIDE] {
    let x = &x[at..];
    seen([lanes_at(x, 0), lanes_at(x, row), lanes_at(x, 2 * row), lanes_at(x, 3 * row)])
}

/// Computes Bᵀ d B of the 4×4 input pixels of each 2×2 output pixels of a convolution: `v` gets, point by point, tile
/// by tile, the channels. `x` lies in `grid`, with its border.
#[macerator::with_simd]
#[allow(clippy::extra_unused_type_parameters, reason = "S says which instructions the loop is compiled for")]
pub(super) fn transform_seen<S: Simd>(x: &[f32], grid: Grid, strip: Strip, v: &mut [f32]) {
    {
        let (channels, row) = (grid.channels, grid.row());
        let (across, step) = (strip.across, strip.matrices(channels).step);
        for (number, ty) in strip.rows().enumerate() {
            for first in (0..channels).step_by(LANES) {
                let from = 2 * ty * row + first;
                // Half of the columns belong to the next tile, too.
                let (mut c0, mut c1) = (column(x, from, row), column(x, from + channels, row));
                for tx in 0..across {
                    let at = from + (2 * tx + 2) * channels;
                    let (c2, c3) = (column(x, at, row), column(x, at + channels, row));
                    let to = &mut v[(number * across + tx) * channels + first..][..(POINTS - 1) * step + LANES];
                    for i in 0..SIDE {
                        let points = seen([&c0[i], &c1[i], &c2[i], &c3[i]]);
                        for j in 0..SIDE {
                            to[(i * SIDE + j) * step..][..LANES].copy_from_slice(&points[j]);
                        }
                    }
                    (c0, c1) = (c2, c3);
                }
            }
        }
    }
}

/// Returns A y of a column: (y₀, y₀ + y₁, y₀ − y₁, −y₁).
#[inline(always)]
fn spread(y0: &Lanes, y1: &Lanes) -> [Lanes; SIDE] {
    [*y0, plus(y0, y1), minus(y0, y1), minus(&[0.0; LANES], y1)]
}

/// Computes A g Aᵀ of each 2×2 pixels of a gradient: `v` gets, point by point, tile by tile, the channels. `grad`
/// lies in `grid`.
#[macerator::with_simd]
#[allow(clippy::extra_unused_type_parameters, reason = "S says which instructions the loop is compiled for")]
pub(super) fn transform_gradient<S: Simd>(grad: &[f32], grid: Grid, strip: Strip, v: &mut [f32]) {
    {
        let (channels, row) = (grid.channels, grid.row());
        let (across, step) = (strip.across, strip.matrices(channels).step);
        for (number, ty) in strip.rows().enumerate() {
            for tx in 0..across {
                for first in (0..channels).step_by(LANES) {
                    let from = &grad[grid.at(2 * ty, 2 * tx) + first..];
                    let left = spread(lanes_at(from, 0), lanes_at(from, row));
                    let right = spread(lanes_at(from, channels), lanes_at(from, row + channels));
                    let to = &mut v[(number * across + tx) * channels + first..][..(POINTS - 1) * step + LANES];
                    for i in 0..SIDE {
                        let points = spread(&left[i], &right[i]);
                        for j in 0..SIDE {
                            to[(i * SIDE + j) * step..][..LANES].copy_from_slice(&points[j]);
                        }
                    }
                }
            }
        }
    }
}

/// Returns Aᵀm of a column: (m₀ + m₁ + m₂, m₁ − m₂ − m₃).
#[inline(always)]
fn gathered([m0, m1, m2, m3]: [&Lanes; SIDE]) -> [Lanes; 2] {
    let (mut top, mut bottom) = ([0.0; LANES], [0.0; LANES]);
    for l in 0..LANES {
        top[l] = m0[l] + m1[l] + m2[l];
    }
    for l in 0..LANES {
        bottom[l] = m1[l] - m2[l] - m3[l];
    }
    [top, bottom]
}

/// Returns [`gathered`] of a column of a tile's points.
#[inline(always)]
fn gathered_column(m: &[f32], j: usize, step: usize) -> [Lanes; 2] {
    let point = [j, SIDE + j, 2 * SIDE + j, 3 * SIDE + j];
    gathered([
        lanes_at(m, point[0] * step),
        lanes_at(m, point[1] * step),
        lanes_at(m, point[2] * step),
        lanes_at(m, point[3] * step),
    ])
}

/// Computes Aᵀ m A of each tile, with the bias of its block: `store` gets the sums by positions in `grid`.
#[macerator::with_simd]
#[allow(clippy::extra_unused_type_parameters, reason = "S says which instructions the loop is compiled for")]
pub(super) fn transform_back<S: Simd, F: Fn(usize) -> Lanes, T: Store>(
    m: &[f32],
    grid: Grid,
    strip: Strip,
    bias: F,
    store: &mut T,
) {
    {
        let (channels, row) = (grid.channels, grid.row());
        let (across, step) = (strip.across, strip.matrices(channels).step);
        for block in 0..channels / LANES {
            let bias = bias(block);
            for (number, ty) in strip.rows().enumerate() {
                for tx in 0..across {
                    let m = &m[(number * across + tx) * channels + block * LANES..][..(POINTS - 1) * step + LANES];
                    let (c0, c1) = (gathered_column(m, 0, step), gathered_column(m, 1, step));
                    let (c2, c3) = (gathered_column(m, 2, step), gathered_column(m, 3, step));
                    let at = grid.at(2 * ty, 2 * tx) + block * LANES;
                    for y in 0..2 {
                        let [left, right] = gathered([&c0[y], &c1[y], &c2[y], &c3[y]]);
                        store.store(at + y * row, LANES, &plus(&left, &bias));
                        store.store(at + y * row + channels, LANES, &plus(&right, &bias));
                    }
                }
            }
        }
    }
}

//! 3×3 convolutions with 2.25 times fewer products: Winograd's F(2×2, 3×3) (Lavin and Gray 2016, "Fast algorithms for
//! convolutional neural networks").
//!
//! The 4×4 input pixels d of 2×2 output pixels, and the 3×3 weights g, become 4×4 points each. The output is Aᵀ[Σ (G
//! g Gᵀ) ⊙ (Bᵀ d B)]A, where the sum over the input channels makes a product of matrices for each point. The gradient
//! of the input is such a convolution again; that of the weights is Gᵀ[Σ (Bᵀ d B) ⊙ (A y Aᵀ)]G for the gradient y of
//! the output.

use super::grid::Grid;
use super::points::{POINTS, Strip, transform_back, transform_gradient, transform_seen};
use super::products::{add_products, products};
use super::shape::{ConvShape, Place};
use crate::nn::cpu::store::Store;
use crate::nn::cpu::tile::{LANES, Lanes};

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
pub(super) fn gradient(shape: ConvShape, sums: &[Lanes], place: Place) -> f32 {
    let Place { o, i, y, x } = place;
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

//! One convolution of one image.

use super::grid::Grid;
use super::shape::{ConvShape, window_places};
use super::winograd::{self, PointBuffers};
use crate::nn::cpu::outer::{column_sums, outer};
use crate::nn::cpu::store::{Add, Store, Write};
use crate::nn::cpu::tile::{LANES, Lanes, Window, correlate};

/// A convolution between two grids.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    shape: ConvShape,
    /// True if it is computed with fewer products: see [`winograd`].
    pub(super) has_points: bool,
    pub(super) input: Grid,
    pub(super) output: Grid,
    /// Position at which the window of each output pixel begins.
    pub(super) starts: Vec<usize>,
    pub(super) outputs: Vec<usize>,
    /// For a gradient that is a convolution: position at which the window of each input pixel begins in the output.
    back: Vec<usize>,
    inputs: Vec<usize>,
}

/// The weights of a layer in the orders in which they are read.
#[derive(Debug)]
pub(super) struct Weights {
    /// For each block of 16 outputs: row, column and input channel of the kernel. Or their [`points`](winograd::points).
    forward: Vec<Lanes>,
    bias: Vec<Lanes>,
    /// If the sizes are the same, as `forward` with inputs and outputs exchanged and the kernel rotated. Otherwise
    /// for each row and 16 numbers of it: the outputs. Or their points.
    backward: Vec<Lanes>,
}

impl Layer {
    /// Returns `None` if the kernel does not fit, or has padding without keeping the size.
    pub(super) fn new(shape: ConvShape, height: usize, width: usize) -> Option<Self> {
        if !shape.same() && shape.padding > 0 {
            return None;
        }
        let ConvShape { kernel, stride, padding, .. } = shape;
        let places = |side| window_places(side, kernel, stride, padding);
        let input = Grid { channels: shape.inputs, height, width, border: padding };
        let output = Grid { channels: shape.outputs, height: places(height)?, width: places(width)?, border: padding };
        let corner = |grid: Grid, y: usize, x: usize| y * grid.row() + x * grid.channels;
        let windows = |to: Grid, from: Grid, stride: usize| -> Vec<usize> {
            (0..to.height).flat_map(|y| (0..to.width).map(move |x| corner(from, y * stride, x * stride))).collect()
        };
        Some(Self {
            shape,
            has_points: winograd::fits(shape, height, width),
            input,
            output,
            starts: windows(output, input, stride),
            outputs: output.places(),
            back: if shape.same() { windows(input, output, 1) } else { Vec::new() },
            inputs: input.places(),
        })
    }

    fn window(&self) -> Window {
        let ConvShape { kernel, inputs, .. } = self.shape;
        Window { count: kernel, step: self.input.row(), len: kernel * inputs }
    }

    /// Returns the layer's weights from its parameters: `[outputs, inputs, kernel, kernel]`, then the biases. The
    /// order for the gradient of the input is left out if it is not needed.
    pub(super) fn weights(&self, params: &[f32], backward: bool) -> Weights {
        let shape = self.shape;
        let (weights, biases) = params.split_at(params.len() - shape.outputs);
        let mut bias = vec![[0.0; LANES]; shape.outputs.div_ceil(LANES)];
        bias.iter_mut().flatten().zip(biases).for_each(|(to, from)| *to = *from);
        if self.has_points {
            let turned = if backward { winograd::points(shape, weights, true) } else { Vec::new() };
            return Weights { forward: winograd::points(shape, weights, false), bias, backward: turned };
        }
        let mut packed = vec![[0.0; LANES]; shape.forward_rows()];
        let mut turned = vec![[0.0; LANES]; if backward { shape.backward_rows() } else { 0 }];
        shape.each_weight(|number, place| {
            let (row, lane) = shape.forward_at(place);
            packed[row][lane] = weights[number];
            if backward {
                let (row, lane) = shape.backward_at(place);
                turned[row][lane] = weights[number];
            }
        });
        Weights { forward: packed, bias, backward: turned }
    }

    /// Returns the rows of sums that [`Self::add_gradients`] adds to.
    pub(super) fn sums(&self) -> usize {
        self.weight_sums() + self.shape.outputs.div_ceil(LANES)
    }

    fn weight_sums(&self) -> usize {
        let ConvShape { inputs, outputs, .. } = self.shape;
        if self.has_points { winograd::rows(inputs, outputs) } else { self.shape.forward_rows() }
    }

    /// Returns the number of parameters, as in [`Self::weights`].
    pub(super) fn params(&self) -> usize {
        self.shape.params()
    }

    /// Computes the convolution: `store` gets the sums of products, with the bias, by positions in the output.
    pub(super) fn forward(&self, x: &[f32], weights: &Weights, buffers: &mut PointBuffers, mut store: impl Store) {
        let channels = self.shape.outputs;
        if self.has_points {
            let (grids, bias) = ((self.input, self.output), |block| weights.bias[block]);
            return winograd::convolve(x, grids, &weights.forward, bias, buffers, store);
        }
        correlate(
            x,
            &self.starts,
            self.window(),
            &weights.forward,
            |block| weights.bias[block],
            true,
            |pixel, block, sums| {
                let first = block * LANES;
                store.store(self.outputs[pixel] + first, channels - first, sums);
            },
        );
    }

    /// Adds the gradients of weights and biases, for an input and the gradient of the output.
    pub(super) fn add_gradients(&self, x: &[f32], grad: &[f32], buffers: &mut PointBuffers, sums: &mut [Lanes]) {
        if !self.has_points {
            return self.add_gradients_at(x, &self.starts, grad, &self.outputs, sums);
        }
        let (weights, bias) = sums.split_at_mut(self.weight_sums());
        winograd::add_gradients(x, grad, (self.input, self.output), buffers, weights);
        column_sums(grad, &self.outputs, bias);
    }

    /// Does [`Self::add_gradients`] for windows and outputs at these positions.
    pub(super) fn add_gradients_at(
        &self,
        x: &[f32],
        starts: &[usize],
        grad: &[f32],
        outputs: &[usize],
        sums: &mut [Lanes],
    ) {
        let (weights, bias) = sums.split_at_mut(self.weight_sums());
        outer(x, starts, self.window(), grad, outputs, weights);
        column_sums(grad, outputs, bias);
    }

    /// Returns the gradients of the parameters, in their order, from sums over all images.
    pub(super) fn gradients(&self, sums: &[Lanes], params: &mut [f32]) {
        let (sums, bias) = sums.split_at(self.weight_sums());
        let (weights, biases) = params.split_at_mut(params.len() - self.shape.outputs);
        self.shape.each_weight(|number, place| {
            let (row, lane) = self.shape.forward_at(place);
            weights[number] =
                if self.has_points { winograd::gradient(self.shape, sums, place) } else { sums[row][lane] };
        });
        biases.iter_mut().zip(bias.iter().flatten()).for_each(|(to, sum)| *to = *sum);
    }

    /// Computes the gradient of the input from one of the output, which has zeros in its border; the input's border
    /// is unchanged.
    pub(super) fn backward(&self, grad: &[f32], weights: &Weights, buffers: &mut PointBuffers, to: &mut [f32]) {
        if self.shape.same() {
            self.backward_same(grad, weights, buffers, Write(to));
        } else {
            self.backward_scatter(grad, weights, to);
        }
    }

    /// Does [`Self::backward`] where input and output are of the same size. `store` gets the gradients, by positions
    /// in the input.
    pub(super) fn backward_same(
        &self,
        grad: &[f32],
        weights: &Weights,
        buffers: &mut PointBuffers,
        mut store: impl Store,
    ) {
        if self.has_points {
            let (grids, bias) = ((self.output, self.input), |_| [0.0; LANES]);
            return winograd::convolve(grad, grids, &weights.backward, bias, buffers, store);
        }
        let ConvShape { inputs, outputs, kernel, .. } = self.shape;
        let window = Window { count: kernel, step: self.output.row(), len: kernel * outputs };
        correlate(
            grad,
            &self.back,
            window,
            &weights.backward,
            |_| [0.0; LANES],
            true,
            |pixel, block, sums| {
                let first = block * LANES;
                store.store(self.inputs[pixel] + first, inputs - first, sums);
            },
        );
    }

    /// Does [`Self::backward`] without padding.
    fn backward_scatter(&self, grad: &[f32], weights: &Weights, to: &mut [f32]) {
        to.fill(0.0);
        let Window { step, len, .. } = self.window();
        let tiles = len.div_ceil(LANES);
        let pixel = Window { count: 1, step: 0, len: self.shape.outputs };
        correlate(
            grad,
            &self.outputs,
            pixel,
            &weights.backward,
            |_| [0.0; LANES],
            // Windows overlap, so they must be added in the same order on every machine. This holds if the two blocks
            // are different channels.
            self.shape.inputs.is_multiple_of(2 * LANES),
            |pixel, tile, sums| {
                let first = tile % tiles * LANES;
                let at = self.starts[pixel] + tile / tiles * step + first;
                Add(&mut *to).store(at, len - first, sums);
            },
        );
    }
}

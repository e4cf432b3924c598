//! One convolution of one image.

use super::grid::Grid;
use super::relu_backward;
use super::tile::{LANES, Lanes, Window, column_sums, correlate, outer};
use crate::nn::window_places;

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
    fn each_weight(self, mut visit: impl FnMut(usize, Place)) {
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

    /// Row and lane of a weight in [`Weights::forward`].
    fn forward_at(self, Place { o, i, y, x }: Place) -> (usize, usize) {
        let rows = self.kernel * self.kernel * self.inputs;
        (o / LANES * rows + (y * self.kernel + x) * self.inputs + i, o % LANES)
    }

    /// Rows in [`Weights::forward`].
    fn forward_rows(self) -> usize {
        self.outputs.div_ceil(LANES) * self.kernel * self.kernel * self.inputs
    }

    /// Row and lane of a weight in [`Weights::backward`].
    fn backward_at(self, Place { o, i, y, x }: Place) -> (usize, usize) {
        if self.same() {
            let rows = self.kernel * self.kernel * self.outputs;
            let turned = (self.kernel - 1 - y) * self.kernel + self.kernel - 1 - x;
            (i / LANES * rows + turned * self.outputs + o, i % LANES)
        } else {
            let (tiles, at) = ((self.kernel * self.inputs).div_ceil(LANES), x * self.inputs + i);
            ((y * tiles + at / LANES) * self.outputs + o, at % LANES)
        }
    }

    /// Rows in [`Weights::backward`].
    fn backward_rows(self) -> usize {
        if self.same() {
            self.inputs.div_ceil(LANES) * self.kernel * self.kernel * self.outputs
        } else {
            (self.kernel * self.inputs).div_ceil(LANES) * self.kernel * self.outputs
        }
    }
}

/// A weight's output and input channel, row and column.
#[derive(Clone, Copy, Debug)]
struct Place {
    o: usize,
    i: usize,
    y: usize,
    x: usize,
}

/// A convolution between two grids.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    shape: ConvShape,
    pub(super) input: Grid,
    pub(super) output: Grid,
    /// Where the window of each output pixel begins.
    starts: Vec<usize>,
    outputs: Vec<usize>,
    /// For a gradient that is a convolution: where the window of each input pixel begins in the output.
    back: Vec<usize>,
    inputs: Vec<usize>,
}

/// The weights of a layer in the orders in which they are read.
#[derive(Debug)]
pub(super) struct Weights {
    /// For each block of 16 outputs: row, column and input channel of the kernel.
    forward: Vec<Lanes>,
    bias: Vec<Lanes>,
    /// If the sizes are the same, as `forward` with inputs and outputs exchanged and the kernel turned around.
    /// Otherwise for each row and 16 numbers of it: the outputs.
    backward: Vec<Lanes>,
}

impl Layer {
    /// `None` if the kernel does not fit, or has padding without keeping the size.
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

    /// The layer's weights from its parameters: `[outputs, inputs, kernel, kernel]`, then the biases. Without the
    /// order for the gradient of the input if it is not needed.
    pub(super) fn weights(&self, params: &[f32], backward: bool) -> Weights {
        let shape = self.shape;
        let (weights, biases) = params.split_at(params.len() - shape.outputs);
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
        let mut bias = vec![[0.0; LANES]; shape.outputs.div_ceil(LANES)];
        bias.iter_mut().flatten().zip(biases).for_each(|(to, from)| *to = *from);
        Weights { forward: packed, bias, backward: turned }
    }

    /// Rows of sums that [`Self::add_gradients`] adds to.
    pub(super) fn sums(&self) -> usize {
        self.shape.forward_rows() + self.shape.outputs.div_ceil(LANES)
    }

    /// Parameters as in [`Self::weights`].
    pub(super) fn params(&self) -> usize {
        self.shape.params()
    }

    /// `store` gets the place of a pixel's first channel of up to 16 in the output, how many they are, and their sums
    /// of products, with the bias.
    pub(super) fn forward(&self, x: &[f32], weights: &Weights, mut store: impl FnMut(usize, usize, &Lanes)) {
        let channels = self.shape.outputs;
        correlate(
            x,
            &self.starts,
            self.window(),
            &weights.forward,
            |block| weights.bias[block],
            true,
            |pixel, block, sums| {
                let first = block * LANES;
                store(self.outputs[pixel] + first, channels - first, sums);
            },
        );
    }

    /// Adds the gradients of weights and biases, for an input and the gradient of the output.
    pub(super) fn add_gradients(&self, x: &[f32], grad: &[f32], sums: &mut [Lanes]) {
        let (weights, bias) = sums.split_at_mut(self.shape.forward_rows());
        outer(x, &self.starts, self.window(), grad, &self.outputs, weights);
        column_sums(grad, &self.outputs, bias);
    }

    /// The gradients of the parameters, in their order, from sums over all images.
    pub(super) fn gradients(&self, sums: &[Lanes], params: &mut [f32]) {
        let (sums, bias) = sums.split_at(self.shape.forward_rows());
        let (weights, biases) = params.split_at_mut(params.len() - self.shape.outputs);
        self.shape.each_weight(|number, place| {
            let (row, lane) = self.shape.forward_at(place);
            weights[number] = sums[row][lane];
        });
        biases.iter_mut().zip(bias.iter().flatten()).for_each(|(to, sum)| *to = *sum);
    }

    /// The gradient of the input for one of the output, which has zeros in its border; the input's is left alone.
    pub(super) fn backward(&self, grad: &[f32], weights: &Weights, to: &mut [f32]) {
        if self.shape.same() {
            self.backward_same(grad, weights, |at, count, sums| put(to, at, count, sums, |to, sum| *to = sum));
        } else {
            self.backward_scatter(grad, weights, to);
        }
    }

    /// As [`Self::backward`], where input and output are of the same size. `store` gets the place of a pixel's first
    /// channel of up to 16 in the input, how many they are, and their gradients.
    pub(super) fn backward_same(&self, grad: &[f32], weights: &Weights, mut store: impl FnMut(usize, usize, &Lanes)) {
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
                store(self.inputs[pixel] + first, inputs - first, sums);
            },
        );
    }

    /// As [`Self::backward`], without padding.
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
            // Windows overlap: the order in which they are added must be the same on every machine.
            false,
            |pixel, tile, sums| {
                let first = tile % tiles * LANES;
                let at = self.starts[pixel] + tile / tiles * step + first;
                put(to, at, len - first, sums, |to, sum| *to += sum);
            },
        );
    }
}

/// Changes `count` numbers from `at` on (at most 16) with those of `lanes`.
#[inline(always)]
pub(super) fn put(to: &mut [f32], at: usize, count: usize, lanes: &Lanes, change: impl Fn(&mut f32, f32)) {
    let to = &mut to[at..];
    match to.first_chunk_mut::<LANES>() {
        Some(to) if count >= LANES => {
            for j in 0..LANES {
                change(&mut to[j], lanes[j]);
            }
        }
        _ => to[..count.min(LANES)].iter_mut().zip(lanes).for_each(|(to, &x)| change(to, x)),
    }
}

/// As [`put`], adds the gradients of a ReLU that gave `mask`.
#[inline(always)]
pub(super) fn add_where(to: &mut [f32], at: usize, count: usize, lanes: &Lanes, mask: &[f32]) {
    let (to, mask) = (&mut to[at..], &mask[at..]);
    match (to.first_chunk_mut::<LANES>(), mask.first_chunk::<LANES>()) {
        (Some(to), Some(mask)) if count >= LANES => {
            for j in 0..LANES {
                to[j] += relu_backward(mask[j], lanes[j]);
            }
        }
        _ => {
            let pairs = to[..count.min(LANES)].iter_mut().zip(mask).zip(lanes);
            pairs.for_each(|((to, &mask), &x)| *to += relu_backward(mask, x));
        }
    }
}

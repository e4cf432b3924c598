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
    /// order for the gradient of the input if nobody asks for it.
    pub(super) fn weights(&self, params: &[f32], backward: bool) -> Weights {
        let ConvShape { inputs, outputs, kernel, .. } = self.shape;
        let (weights, bias) = params.split_at(params.len() - outputs);
        let at = |o: usize, i: usize, y: usize, x: usize| weights[((o * inputs + i) * kernel + y) * kernel + x];
        let mut packed = Vec::with_capacity(outputs.div_ceil(LANES) * kernel * kernel * inputs);
        for first in (0..outputs).step_by(LANES) {
            each_weight(kernel, inputs, |y, x, i| packed.push(lanes(outputs - first, |o| at(first + o, i, y, x))));
        }
        let mut turned = Vec::new();
        if backward && self.shape.same() {
            for first in (0..inputs).step_by(LANES) {
                each_weight(kernel, outputs, |y, x, o| {
                    let (y, x) = (kernel - 1 - y, kernel - 1 - x);
                    turned.push(lanes(inputs - first, |i| at(o, first + i, y, x)));
                });
            }
        } else if backward {
            let row = kernel * inputs;
            for y in 0..kernel {
                for first in (0..row).step_by(LANES) {
                    let of = |o| lanes(row - first, |k| at(o, (first + k) % inputs, y, (first + k) / inputs));
                    turned.extend((0..outputs).map(of));
                }
            }
        }
        let bias = (0..outputs).step_by(LANES).map(|first| lanes(outputs - first, |o| bias[first + o]));
        Weights { forward: packed, bias: bias.collect(), backward: turned }
    }

    /// Numbers that [`Self::add_gradients`] adds to.
    pub(super) fn sums(&self) -> usize {
        let ConvShape { inputs, outputs, kernel, .. } = self.shape;
        outputs.div_ceil(LANES) * (kernel * kernel * inputs + 1)
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
            |pixel, block, sums| {
                let first = block * LANES;
                store(self.outputs[pixel] + first, channels - first, sums);
            },
        );
    }

    /// Adds the gradients of weights and biases, for an input and the gradient of the output.
    pub(super) fn add_gradients(&self, x: &[f32], grad: &[f32], sums: &mut [Lanes]) {
        let (weights, bias) = sums.split_at_mut(sums.len() - self.shape.outputs.div_ceil(LANES));
        outer(x, &self.starts, self.window(), grad, &self.outputs, weights);
        column_sums(grad, &self.outputs, bias);
    }

    /// The gradients of the parameters, in their order, from sums over all images.
    pub(super) fn gradients(&self, sums: &[Lanes], params: &mut [f32]) {
        let ConvShape { inputs, outputs, kernel, .. } = self.shape;
        let (sums, bias) = sums.split_at(sums.len() - outputs.div_ceil(LANES));
        let (weights, biases) = params.split_at_mut(params.len() - outputs);
        let mut rows = sums.iter();
        for first in (0..outputs).step_by(LANES) {
            each_weight(kernel, inputs, |y, x, i| {
                for (o, &sum) in (first..outputs).zip(rows.next().into_iter().flatten()) {
                    weights[((o * inputs + i) * kernel + y) * kernel + x] = sum;
                }
            });
        }
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

/// The first `count` lanes by `value`, the others 0.
fn lanes(count: usize, value: impl Fn(usize) -> f32) -> Lanes {
    std::array::from_fn(|j| if j < count { value(j) } else { 0.0 })
}

/// Row, column and channel of each weight, in the order in which a window is read.
fn each_weight(kernel: usize, channels: usize, mut visit: impl FnMut(usize, usize, usize)) {
    for y in 0..kernel {
        for x in 0..kernel {
            for i in 0..channels {
                visit(y, x, i);
            }
        }
    }
}

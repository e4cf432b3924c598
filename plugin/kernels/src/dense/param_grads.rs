//! Gradients of weights and biases: sums over all rows.

use crate::{
    among_workers::threads,
    elementwise::{Activation, Store, Write, relu_backward, vectorized},
    kept_memory::{KeptMemory, share_each},
    tile::{BLOCK, LANES, Lanes, WIDE_ROWS, Window, column_sums, outer},
};

/// Smallest and largest number of rows of weights that a thread takes at a time. Many are less work together: they share
/// what is read of the gradients. Few are there for all threads in a layer of 200.
const PART: [usize; 2] = [16, 48];

/// Returns the number of rows of weights that a thread takes at a time, of so many.
fn part(inputs: usize) -> usize {
    (inputs / (2 * threads())).next_multiple_of(WIDE_ROWS).clamp(PART[0], PART[1])
}

/// The inputs of the gradients of a layer's parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerSums<'a> {
    /// Input of the layer, `[n, inputs]`.
    pub(crate) x: &'a [f32],
    pub(crate) inputs: usize,
    /// The gradients of x W + b.
    pub(crate) sums: &'a SumGrads,
}

/// The gradients of weights `[inputs, outputs]` and of biases.
#[derive(Debug)]
pub(crate) struct ParamGrads {
    pub(crate) weights: Vec<f32>,
    pub(crate) bias: Vec<f32>,
}

/// Returns the gradients of each layer's parameters.
pub(crate) fn param_grads(layers: &[LayerSums<'_>]) -> Vec<ParamGrads> {
    let empty = layers.iter().map(|LayerSums { inputs, sums, .. }| ParamGrads {
        weights: KeptMemory::take(inputs * sums.columns).into_vec(),
        bias: vec![0.0; sums.columns],
    });
    let mut found: Vec<ParamGrads> = empty.collect();
    let places =
        |layer: &LayerSums<'_>| (0..layer.x.len() / layer.inputs).map(|row| row * layer.sums.stride()).collect();
    let places: Vec<Vec<usize>> = layers.iter().map(places).collect();
    let parts = found.iter_mut().zip(layers).zip(&places).flat_map(|((found, layer), places)| {
        let mut bias = Some(&mut *found.bias);
        let rows = part(layer.inputs);
        let weights = found.weights.chunks_mut(rows * layer.sums.columns).enumerate();
        weights.map(move |(part, weights)| Part { layer, places, first: part * rows, weights, bias: bias.take() })
    });
    let products = |layer: &LayerSums<'_>| layer.x.len() * layer.sums.columns;
    share_each(&mut parts.collect::<Vec<_>>(), layers.iter().map(products).sum(), |_, part| part.sum());
    found
}

/// Some rows of weights.
struct Part<'a> {
    layer: &'a LayerSums<'a>,
    /// Positions at which the rows of the gradients begin.
    places: &'a [usize],
    /// The first of them.
    first: usize,
    weights: &'a mut [f32],
    /// The biases, in the first part only.
    bias: Option<&'a mut [f32]>,
}

impl Part<'_> {
    fn sum(&mut self) {
        let (columns, y) = (self.layer.sums.columns, self.layer.sums.values());
        let rows = self.weights.len() / columns;
        let mut memory = KeptMemory::zeros(columns.div_ceil(LANES) * rows * LANES);
        let sums: &mut [Lanes] = memory.as_chunks_mut().0;
        self.add_products(y, rows, sums);
        for (block, sums) in sums.chunks_exact(rows).enumerate() {
            let first = block * LANES;
            for (row, sums) in sums.iter().enumerate() {
                Write(&mut *self.weights).store(row * columns + first, columns - first, sums);
            }
        }
        if let Some(bias) = &mut self.bias {
            let mut sums = vec![[0.0; LANES]; columns.div_ceil(LANES)];
            column_sums(y, self.places, &mut sums);
            bias.copy_from_slice(&sums.as_flattened()[..columns]);
        }
    }

    /// Adds the products of inputs and gradients.
    fn add_products(&self, y: &[f32], rows: usize, sums: &mut [Lanes]) {
        let LayerSums { x, inputs, .. } = *self.layer;
        let window = Window { count: 1, step: 0, len: rows };
        // Rows of wide layers would share few lines of the cache, so they are copied, with an odd number of lines for each. A
        // few numbers beyond a row are read and not used.
        let stride = ((rows + WIDE_ROWS).div_ceil(LANES) | 1) * LANES;
        let starts: Vec<usize> = (0..BLOCK.min(self.places.len())).map(|row| row * stride).collect();
        let mut seen = KeptMemory::take(starts.len() * stride);
        for (x, places) in x.chunks(BLOCK * inputs).zip(self.places.chunks(BLOCK)) {
            for (to, x) in seen.chunks_exact_mut(stride).zip(x.chunks_exact(inputs)) {
                // Whole blocks are copied without a call.
                let (blocks, rest) = x[self.first..][..rows].as_chunks::<LANES>();
                let (to_blocks, _) = to.as_chunks_mut();
                to_blocks.iter_mut().zip(blocks).for_each(|(to, x)| *to = *x);
                to[LANES * blocks.len()..][..rest.len()].copy_from_slice(rest);
            }
            outer(&seen, &starts[..places.len()], window, y, places, sums);
        }
    }
}

// Gradients of sums, laid out for products.

/// The gradient of x W + b: `[n, columns]`, its rows filled up to whole blocks of 16.
#[derive(Debug)]
pub(crate) struct SumGrads {
    pub(super) columns: usize,
    values: KeptMemory,
}

impl SumGrads {
    /// Allocates numbers that are yet to be written.
    pub(crate) fn unwritten(n: usize, columns: usize) -> Self {
        Self { columns, values: KeptMemory::take(n * stride(columns)) }
    }

    /// Returns the distance from one row to the next.
    pub(crate) fn stride(&self) -> usize {
        stride(self.columns)
    }

    /// Returns all rows.
    pub(crate) fn values(&self) -> &[f32] {
        &self.values
    }

    /// Returns all rows, to be written; their padding does not matter.
    pub(crate) fn values_mut(&mut self) -> &mut [f32] {
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

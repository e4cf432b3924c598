//! The computation of a trunk of convolutions: one convolution of one image, all stages with their layout in memory,
//! and the gradients of several images.

use crate::{
    elementwise::{Add, Store, Write},
    tile::{LANES, Lanes, Window, column_sums, correlate, outer},
    trunk::{
        grid::{ConvShape, Grid, pooled, window_places},
        winograd,
        winograd::PointBuffers,
    },
};

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
    /// For each block of 16 outputs: row, column and input channel of the kernel. Or their
    /// [`points`](crate::trunk::winograd::points).
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

    /// Writes the gradients of the parameters, in their order, from sums over all images.
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

// The computation for each image, and its layout in memory.

/// One stage of a trunk.
#[derive(Clone, Copy, Debug)]
pub(super) enum StageShape {
    /// A convolution, then ReLU.
    Relu(ConvShape),
    /// A convolution, then max-pooling of 3×3 at every second pixel.
    Pool(ConvShape),
    /// x + conv1(relu(conv0(relu(x)))).
    Residual([ConvShape; 2]),
}

/// A stage with the numbers of its layers and of the slots and buffers that it reads and writes.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    Relu { layer: usize, input: usize, output: usize },
    Pool { layer: usize, input: usize, output: usize, wide: usize, marks: usize },
    Residual { layers: [usize; 2], x: usize, relu: usize, inner: usize },
}

/// Positions of the slots in the memory of one image: a step always writes behind the slot that it reads.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    slots: Vec<(usize, usize)>,
    pub(super) len: usize,
}

/// A trunk for images of one size.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) layers: Vec<Layer>,
    pub(super) steps: Vec<Step>,
    /// The computed slots; slot 0 is the image.
    pub(super) slots: Vec<Grid>,
    /// The slot of the result, before the last ReLU.
    pub(super) last: usize,
    /// Stages before their pooling, which are needed only briefly.
    pub(super) wides: Vec<Grid>,
    /// A layout with room for every slot: the backward pass needs them all.
    pub(super) kept: Layout,
    /// A layout in which a stage's later blocks share the room of the first block.
    pub(super) lean: Layout,
    /// Marks of the poolings of an image; not 0, so that those of all images can be split.
    pub(super) marks: usize,
}

impl Layout {
    fn add(&mut self, grid: Grid) {
        self.slots.push((self.len, grid.len()));
        self.len += grid.len();
    }

    fn share(&mut self, slot: usize) {
        self.slots.push(self.slots[slot]);
    }

    /// Returns the position at which a slot begins.
    pub(super) fn start(&self, slot: usize) -> usize {
        self.slots[slot].0
    }

    /// Returns a slot's numbers.
    pub(super) fn read<'a>(&self, slot: usize, values: &'a [f32]) -> &'a [f32] {
        let (start, len) = self.slots[slot];
        &values[start..start + len]
    }

    /// Returns a slot's numbers, mutably.
    pub(super) fn write<'a>(&self, slot: usize, values: &'a mut [f32]) -> &'a mut [f32] {
        let (start, len) = self.slots[slot];
        &mut values[start..start + len]
    }

    /// Returns the numbers of two slots, of which the second is behind the first.
    pub(super) fn two<'a>(&self, first: usize, second: usize, values: &'a mut [f32]) -> (&'a mut [f32], &'a mut [f32]) {
        let ((start, len), (split, second)) = (self.slots[first], self.slots[second]);
        let (before, after) = values.split_at_mut(split);
        (&mut before[start..start + len], &mut after[..second])
    }
}

impl Plan {
    /// Creates the plan. Returns `None` without stages, or if they do not fit each other or an image `[channels,
    /// height, width]`.
    pub(super) fn new(stages: &[StageShape], [channels, height, width]: [usize; 3]) -> Option<Self> {
        let (StageShape::Relu(first) | StageShape::Pool(first) | StageShape::Residual([first, _])) = stages.first()?;
        let mut plan = Self {
            layers: Vec::new(),
            steps: Vec::new(),
            slots: Vec::new(),
            last: 0,
            wides: Vec::new(),
            kept: Layout::default(),
            lean: Layout::default(),
            marks: 0,
        };
        plan.slot(Grid { channels, height, width, border: first.padding }, None);
        for &stage in stages {
            let step = plan.step(stage)?;
            plan.steps.push(step);
        }
        plan.marks = plan.marks.max(1);
        Some(plan)
    }

    /// Returns the number of features of an image.
    pub(super) fn features(&self) -> usize {
        self.slots[self.last].numbers()
    }

    fn step(&mut self, stage: StageShape) -> Option<Step> {
        let input = self.last;
        match stage {
            StageShape::Relu(shape) => {
                let (layer, output) = self.layer(shape, self.slots[input])?;
                self.last = self.slot(output, None);
                Some(Step::Relu { layer, input, output: self.last })
            }
            StageShape::Pool(shape) => {
                let (layer, wide) = self.layer(shape, self.slots[input])?;
                // The windows of the pooling reach into the border.
                let output = (wide.border == 1).then(|| Grid {
                    height: pooled(wide.height),
                    width: pooled(wide.width),
                    ..wide
                })?;
                self.last = self.slot(output, None);
                self.wides.push(wide);
                let marks = self.marks;
                self.marks += output.numbers();
                Some(Step::Pool { layer, input, output: self.last, wide: self.wides.len() - 1, marks })
            }
            StageShape::Residual([shape0, shape1]) => {
                // It changes its input in place, but the backward pass of a ReLU needs that input.
                if matches!(self.steps.last(), Some(Step::Relu { .. })) {
                    return None;
                }
                let x = self.slots[input];
                let (layer0, inside) = self.layer(shape0, x)?;
                let (layer1, output) = self.layer(shape1, inside)?;
                let before = match self.steps.last() {
                    Some(&Step::Residual { relu, inner, .. }) if self.slots[inner] == inside => Some((relu, inner)),
                    _ => None,
                };
                let relu = self.slot(x, before.map(|(relu, _)| relu));
                let inner = self.slot(inside, before.map(|(_, inner)| inner));
                (output == x).then_some(Step::Residual { layers: [layer0, layer1], x: input, relu, inner })
            }
        }
    }

    /// Adds a layer that reads `input`; returns its number and its output.
    fn layer(&mut self, shape: ConvShape, input: Grid) -> Option<(usize, Grid)> {
        let layer = Layer::new(shape, input.height, input.width).filter(|layer| layer.input == input)?;
        let output = layer.output;
        self.layers.push(layer);
        Some((self.layers.len() - 1, output))
    }

    /// Adds a slot; in the lean layout it may share the room of an older one.
    fn slot(&mut self, grid: Grid, shared: Option<usize>) -> usize {
        self.slots.push(grid);
        self.kept.add(grid);
        match shared {
            Some(slot) => self.lean.share(slot),
            None => self.lean.add(grid),
        }
        self.slots.len() - 1
    }
}

// The gradients of weights over several images at once.
//
// A layer with many weights and few pixels takes longer to fetch its sums than to add to them. If no memory of an
// image is written twice, the gradients of several images are collected and added together. The order of the sums
// stays the same.

/// Number of images that are taken together.
pub(super) const IMAGES: usize = 4;

/// Positions of the pixels of several images, layer by layer.
#[derive(Clone, Debug)]
pub(super) struct Group {
    layers: Vec<Places>,
}

#[derive(Clone, Debug)]
struct Places {
    /// Positions at which the windows of all images begin.
    starts: Vec<usize>,
    /// Positions of their outputs.
    outputs: Vec<usize>,
}

impl Group {
    /// Returns `None` if a stage writes memory twice, or has products of its own.
    pub(super) fn new(plan: &Plan) -> Option<Self> {
        let places = |step: &Step| match *step {
            Step::Relu { layer, input, output } if !plan.layers[layer].has_points => {
                Some(Places::new(&plan.layers[layer], plan.kept.start(input), plan.lean.start(output), plan))
            }
            _ => None,
        };
        Some(Self { layers: plan.steps.iter().map(places).collect::<Option<_>>()? })
    }

    /// Adds the gradients of `count` images to those of each layer; `values` and `grads` are those of all images.
    pub(super) fn add_gradients(
        &self,
        plan: &Plan,
        count: usize,
        values: &[f32],
        grads: &[f32],
        sums: &mut [&mut [Lanes]],
    ) {
        for ((layer, places), sums) in plan.layers.iter().zip(&self.layers).zip(sums) {
            let pixels = places.starts.len() / IMAGES * count;
            layer.add_gradients_at(values, &places.starts[..pixels], grads, &places.outputs[..pixels], sums);
        }
    }
}

impl Places {
    fn new(layer: &Layer, input: usize, output: usize, plan: &Plan) -> Self {
        let all = |places: &[usize], from: usize, step: usize| -> Vec<usize> {
            (0..IMAGES).flat_map(|image| places.iter().map(move |place| image * step + from + place)).collect()
        };
        Self { starts: all(&layer.starts, input, plan.kept.len), outputs: all(&layer.outputs, output, plan.lean.len) }
    }
}

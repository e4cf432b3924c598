//! The computation for each image, and its layout in memory.

use super::grid::Grid;
use super::layer::Layer;
use super::pool::pooled;
use super::shape::ConvShape;

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

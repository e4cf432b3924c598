//! Sizes of a recurrent layer's sequence, and what its forward pass leaves for the backward pass.

use burn::backend::Backend;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Slice;

/// Sizes of a layer's sequence.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    pub(super) steps: usize,
    pub(super) batch: usize,
    pub(super) hidden: usize,
    pub(super) directions: usize,
}

/// What a forward pass leaves for the backward pass.
#[derive(Debug)]
pub(in crate::nn) struct Scan {
    pub(super) sizes: Sizes,
    pub(super) directions: Vec<Direction>,
}

/// One direction's numbers, `[T * B, hidden]` each, time-major.
#[derive(Debug)]
pub(super) struct Direction {
    pub(super) backwards: bool,
    pub(super) r: Vec<f32>,
    pub(super) z: Vec<f32>,
    pub(super) n: Vec<f32>,
    pub(super) c_n: Vec<f32>,
    /// `[(T + 1) * B, hidden]`: the state before the first step and after each, in order of time.
    pub(super) states: Vec<f32>,
}

impl Sizes {
    pub(super) fn gates(self) -> usize {
        3 * self.hidden
    }

    /// Numbers in one step of states.
    pub(super) fn block(self) -> usize {
        self.batch * self.hidden
    }

    /// The time steps in the order in which a direction reads them.
    pub(super) fn order(self, backwards: bool) -> impl Iterator<Item = usize> {
        (0..self.steps).map(move |s| if backwards { self.steps - 1 - s } else { s })
    }
}

impl Direction {
    /// Where in `states` the state before and after the step at time `t` begin, in blocks.
    pub(super) fn around(&self, t: usize) -> (usize, usize) {
        if self.backwards { (t + 1, t) } else { (t, t + 1) }
    }
}

/// W_hh of each direction, `[hidden, 3 * hidden]`.
pub(super) fn per_direction<B: Backend>(weight: &FloatTensor<B>, sizes: Sizes) -> Vec<FloatTensor<B>> {
    let (hidden, gates) = (sizes.hidden, sizes.gates());
    (0..sizes.directions)
        .map(|d| {
            let slices = [d..d + 1, 0..hidden, 0..gates].map(Slice::from);
            B::float_reshape(B::float_slice(weight.clone(), &slices), [hidden, gates].into())
        })
        .collect()
}

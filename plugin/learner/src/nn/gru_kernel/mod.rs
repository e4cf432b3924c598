//! The recurrent part of a GRU layer over all its steps, forward and backward, in plain loops.
//!
//! Against a graph of tensor operations this saves the copies of gates and states, and it takes the gradient of W_hh
//! as one product over all steps. The two directions are computed at the same time; within a direction nothing
//! depends on the number of threads.
//!
//! With a = x W_i + b_i and c = h W_h + b_h for each gate (see [`super::Gru`]): r = σ(a_r + c_r), z = σ(a_z + c_z),
//! n = tanh(a_n + r c_n), h' = n + z (h - n).

mod backward;
mod forward;

pub(super) use backward::{ScanGrads, backward};
pub(super) use forward::forward;

use burn::backend::Backend;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Slice;

/// Sizes of a layer's sequence.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    steps: usize,
    batch: usize,
    hidden: usize,
    directions: usize,
}

/// What a forward pass leaves for the backward pass.
#[derive(Debug)]
pub(super) struct Scan {
    sizes: Sizes,
    directions: Vec<Direction>,
}

/// One direction's numbers, `[T * B, hidden]` each, time-major.
#[derive(Debug)]
struct Direction {
    backwards: bool,
    r: Vec<f32>,
    z: Vec<f32>,
    n: Vec<f32>,
    c_n: Vec<f32>,
    /// `[(T + 1) * B, hidden]`: the state before the first step and after each, in order of time.
    states: Vec<f32>,
}

impl Sizes {
    fn gates(self) -> usize {
        3 * self.hidden
    }

    /// Numbers in one step of states.
    fn block(self) -> usize {
        self.batch * self.hidden
    }

    /// The time steps in the order in which a direction reads them.
    fn order(self, backwards: bool) -> impl Iterator<Item = usize> {
        (0..self.steps).map(move |s| if backwards { self.steps - 1 - s } else { s })
    }
}

impl Direction {
    /// Where in `states` the state before and after the step at time `t` begin, in blocks.
    fn around(&self, t: usize) -> (usize, usize) {
        if self.backwards { (t + 1, t) } else { (t, t + 1) }
    }
}

/// W_hh of each direction, `[hidden, 3 * hidden]`.
fn per_direction<B: Backend>(weight: &FloatTensor<B>, sizes: Sizes) -> Vec<FloatTensor<B>> {
    let (hidden, gates) = (sizes.hidden, sizes.gates());
    (0..sizes.directions)
        .map(|d| {
            let slices = [d..d + 1, 0..hidden, 0..gates].map(Slice::from);
            B::float_reshape(B::float_slice(weight.clone(), &slices), [hidden, gates].into())
        })
        .collect()
}

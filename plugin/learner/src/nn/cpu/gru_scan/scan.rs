//! Sizes, inputs and intermediate results of a recurrent layer's sequence.

use crate::nn::cpu::kept_memory::KeptMemory;

/// Sizes of a layer's sequence.
#[derive(Clone, Copy, Debug)]
pub(in crate::nn) struct Sizes {
    pub(in crate::nn) steps: usize,
    pub(in crate::nn) batch: usize,
    pub(in crate::nn) inputs: usize,
    pub(in crate::nn) hidden: usize,
    pub(in crate::nn) directions: usize,
}

/// The inputs of a layer, in host memory: see [`crate::nn::cpu::kernels::GruInput`].
#[derive(Clone, Copy, Debug)]
pub(in crate::nn) struct ScanInput<'a> {
    pub(in crate::nn) x: &'a [f32],
    pub(in crate::nn) weight_ih: &'a [f32],
    pub(in crate::nn) weight_hh: &'a [f32],
}

/// The data that a forward pass keeps for the backward pass.
#[derive(Debug)]
pub(in crate::nn) struct Scan {
    pub(in crate::nn) sizes: Sizes,
    pub(super) directions: Vec<Direction>,
}

/// One direction's numbers, `[T * B, hidden]` each, time-major.
#[derive(Debug)]
pub(super) struct Direction {
    pub(super) backwards: bool,
    pub(super) r: KeptMemory,
    pub(super) z: KeptMemory,
    pub(super) n: KeptMemory,
    pub(super) c_n: KeptMemory,
    /// `[(T + 1) * B, hidden]`: the state before the first step and after each, in order of time.
    pub(super) states: KeptMemory,
}

impl Sizes {
    pub(super) fn rows(self) -> usize {
        self.steps * self.batch
    }

    pub(super) fn gates(self) -> usize {
        3 * self.hidden
    }

    /// Returns the numbers in one step of states.
    pub(super) fn block(self) -> usize {
        self.batch * self.hidden
    }

    /// Returns the time steps in the order in which a direction reads them.
    pub(super) fn order(self, backwards: bool) -> impl Iterator<Item = usize> {
        (0..self.steps).map(move |s| if backwards { self.steps - 1 - s } else { s })
    }
}

impl Direction {
    /// Returns the positions in `states` of the state before and after the step at time `t`, in blocks.
    pub(super) fn around(&self, t: usize) -> (usize, usize) {
        if self.backwards { (t + 1, t) } else { (t, t + 1) }
    }
}

/// Returns a direction's part of data that all directions share.
pub(super) fn of_direction(all: &[f32], d: usize, directions: usize) -> &[f32] {
    let len = all.len() / directions;
    &all[d * len..(d + 1) * len]
}

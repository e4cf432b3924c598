//! Gradients by parameter name.

use crate::{
    LearnError,
    device::read,
    nn::params::{ParamVisitor, Parameters},
};
use burn::tensor::{Gradients, Tensor, TensorData};
use playbot_kernels::{
    KeptMemory,
    kept_memory::{OF_A_MOVE, share, share_each},
};

/// Numbers whose squares are summed at a time, and added to those of another part of the batch.
const BLOCK: usize = 1 << 16;

/// The gradients of a network's parameters on the host, in the order of [`Parameters::visit`].
#[derive(Clone, Debug, Default)]
pub struct NamedGrads {
    entries: Vec<(String, TensorData)>,
}

impl Drop for NamedGrads {
    fn drop(&mut self) {
        // The next step's gradients reuse the memory.
        for (_, values) in self.entries.drain(..) {
            if let Ok(numbers) = values.try_into_vec::<f32>() {
                KeptMemory::leave(numbers);
            }
        }
    }
}

impl NamedGrads {
    /// Reads the gradient of every parameter of `network`; zeros if the loss does not depend on it.
    ///
    /// # Errors
    /// [`LearnError::Device`] if a tensor cannot be read.
    pub fn read<M: Parameters>(network: &mut M, prefix: &str, grads: &Gradients) -> Result<Self, LearnError> {
        let mut reader = Reader { source: Source::Shared(grads), entries: Vec::new(), error: None };
        network.visit(prefix, &mut reader);
        reader.finish()
    }

    /// Reads the gradients as [`Self::read`], but takes them away from `grads`, which saves a copy of each.
    ///
    /// # Errors
    /// [`LearnError::Device`] if a tensor cannot be read.
    pub fn take<M: Parameters>(network: &mut M, prefix: &str, mut grads: Gradients) -> Result<Self, LearnError> {
        let mut reader = Reader { source: Source::Owned(&mut grads), entries: Vec::new(), error: None };
        network.visit(prefix, &mut reader);
        reader.finish()
    }

    /// Adds the gradients of the same network for other rows. Added to an empty set, they become the set.
    pub(crate) fn add(&mut self, more: Self) {
        if self.entries.is_empty() {
            *self = more;
            return;
        }
        for ((_, to), (_, from)) in self.entries.iter_mut().zip(&more.entries) {
            let to = to.as_mut_slice::<f32>().expect("gradients are checked to be f32 when they are read");
            let (from, moves) = (numbers(from), to.len() * OF_A_MOVE);
            share(to, BLOCK, moves, |block, to| {
                to.iter_mut().zip(&from[block * BLOCK..]).for_each(|(to, from)| *to += from);
            });
        }
    }

    /// Returns the gradients, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &[f32])> {
        self.entries.iter().map(|(name, values)| (name.as_str(), numbers(values)))
    }

    /// Returns the gradient of the parameter called `name`.
    pub fn get(&self, name: &str) -> Option<&[f32]> {
        self.iter().find(|(n, _)| *n == name).map(|(_, values)| values)
    }

    /// Returns the Euclidean norm over all gradients together.
    pub fn norm(&self) -> f64 {
        let all: usize = self.entries.iter().map(|(_, values)| values.num_elements()).sum();
        // Each sum is made by one thread, and the sums are added in order.
        let blocks = self.entries.iter().flat_map(|(_, values)| numbers(values).chunks(BLOCK));
        let mut sums: Vec<(&[f32], f64)> = blocks.map(|block| (block, 0.0)).collect();
        share_each(&mut sums, all * OF_A_MOVE, |_, (block, sum)| *sum = square_sum(block));
        sums.iter().map(|(_, sum)| sum).sum::<f64>().sqrt()
    }

    /// Returns the factor that scales a total norm down to `max_norm`: min(1, max_norm / (norm + 1e-6)).
    ///
    /// # Errors
    /// [`LearnError::NotFinite`] names the first gradient that is not finite.
    pub fn clip_factor(&self, max_norm: f64, steps: u64) -> Result<(f64, f64), LearnError> {
        let norm = self.norm();
        if norm.is_finite() {
            return Ok((norm, (max_norm / (norm + 1e-6)).min(1.0)));
        }
        let bad = self.entries.iter().find(|(_, values)| !square_sum(numbers(values)).is_finite());
        let tensor = bad.map_or("gradients", |(name, _)| name.as_str());
        Err(LearnError::NotFinite { tensor: format!("gradient of {tensor}"), steps: Some(steps) })
    }
}

/// Returns the sum of squares in double precision, over eight lanes so that the compiler can vectorise it.
fn square_sum(values: &[f32]) -> f64 {
    let mut lanes = [0.0f64; 8];
    let chunks = values.chunks_exact(8);
    let rest: f64 = chunks.remainder().iter().map(|&x| f64::from(x) * f64::from(x)).sum();
    for chunk in chunks {
        for (lane, &x) in lanes.iter_mut().zip(chunk) {
            *lane += f64::from(x) * f64::from(x);
        }
    }
    lanes.iter().sum::<f64>() + rest
}

fn numbers(values: &TensorData) -> &[f32] {
    values.as_slice().expect("gradients are checked to be f32 when they are read")
}

enum Source<'a> {
    Shared(&'a Gradients),
    Owned(&'a mut Gradients),
}

struct Reader<'a> {
    source: Source<'a>,
    entries: Vec<(String, TensorData)>,
    error: Option<LearnError>,
}

impl Reader<'_> {
    fn finish(self) -> Result<NamedGrads, LearnError> {
        self.error.map_or(Ok(NamedGrads { entries: self.entries }), Err)
    }
}

impl ParamVisitor for Reader<'_> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        let grad = match &mut self.source {
            Source::Shared(grads) => tensor.grad(grads),
            Source::Owned(grads) => tensor.grad_remove(grads),
        };
        let values = match grad {
            Some(grad) => read::<f32, _, _>(grad),
            None => Ok(TensorData::zeros::<f32, _>(tensor.dims())),
        };
        match values {
            Ok(values) => self.entries.push((name.to_owned(), values)),
            Err(error) => self.error = self.error.take().or(Some(error)),
        }
    }
}

//! Gradients by parameter name.

use super::params::{ParamVisitor, Parameters};
use super::tensors::host;
use crate::LearnError;
use burn::tensor::{Gradients, Tensor};

/// The gradients of a network's parameters on the host, in the order of [`Parameters::visit`].
#[derive(Clone, Debug, Default)]
pub struct NamedGrads {
    entries: Vec<(String, Vec<f32>)>,
}

impl NamedGrads {
    /// Reads the gradient of every parameter of `network`, zeros where the loss does not depend on it.
    ///
    /// # Errors
    /// [`LearnError::Device`] if a tensor cannot be read.
    pub fn read<M: Parameters>(network: &mut M, prefix: &str, grads: &Gradients) -> Result<Self, LearnError> {
        let mut reader = Reader { grads, entries: Vec::new(), error: None };
        network.visit(prefix, &mut reader);
        match reader.error {
            Some(error) => Err(error),
            None => Ok(Self { entries: reader.entries }),
        }
    }

    /// The gradients, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &[f32])> {
        self.entries.iter().map(|(name, values)| (name.as_str(), values.as_slice()))
    }

    /// The gradient of the parameter called `name`.
    pub fn get(&self, name: &str) -> Option<&[f32]> {
        self.iter().find(|(n, _)| *n == name).map(|(_, values)| values)
    }

    /// The Euclidean norm over all gradients together.
    pub fn norm(&self) -> f64 {
        self.entries.iter().map(|(_, values)| square_sum(values)).sum::<f64>().sqrt()
    }

    /// The factor that brings a total norm down to `max_norm`: min(1, max_norm / (norm + 1e-6)).
    ///
    /// # Errors
    /// [`LearnError::NotFinite`] names the first gradient that is not finite.
    pub fn clip_factor(&self, max_norm: f64, steps: u64) -> Result<(f64, f64), LearnError> {
        let norm = self.norm();
        if norm.is_finite() {
            return Ok((norm, (max_norm / (norm + 1e-6)).min(1.0)));
        }
        let bad = self.entries.iter().find(|(_, values)| !square_sum(values).is_finite());
        let tensor = bad.map_or("gradients", |(name, _)| name.as_str());
        Err(LearnError::NotFinite { tensor: format!("gradient of {tensor}"), steps })
    }
}

/// Sum of squares in double precision, over eight lanes so that the compiler can vectorise it.
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

struct Reader<'a> {
    grads: &'a Gradients,
    entries: Vec<(String, Vec<f32>)>,
    error: Option<LearnError>,
}

impl ParamVisitor for Reader<'_> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        let values = match tensor.grad(self.grads) {
            Some(grad) => host(grad),
            None => Ok(vec![0.0; tensor.dims().iter().product()]),
        };
        match values {
            Ok(values) => self.entries.push((name.to_owned(), values)),
            Err(error) => self.error = self.error.take().or(Some(error)),
        }
    }
}

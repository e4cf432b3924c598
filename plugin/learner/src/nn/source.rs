//! Sources of a new network's parameters: a generator or a file.

use super::init::{orthogonal, uniform};
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;
use std::convert::Infallible;

/// Starting values of a parameter.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Init {
    /// Zeros.
    Zeros,
    /// Ones.
    Ones,
    /// A matrix of `shape[0]` rows with orthonormal rows or columns, times this gain.
    Orthogonal(f64),
    /// Uniform in ± this bound.
    Uniform(f64),
}

/// A source of a network's parameters while it is made.
///
/// Only the function that makes a network knows its sizes. From a generator it makes a fresh network, from a file the
/// stored one. A file whose contents do not match its header is refused at the first tensor, before memory of a size
/// from the header is allocated. Since sizes may come from such a header, sums and products of them saturate.
pub(crate) trait ParamSource {
    /// The reason why a parameter is unavailable.
    type Error;

    /// Returns the parameter called `name`, of `shape`.
    ///
    /// # Errors
    /// [`Self::Error`] if there is no such parameter.
    fn param<const D: usize>(&mut self, name: &str, shape: [usize; D], init: Init) -> Result<Tensor<D>, Self::Error>;
}

/// Starting weights from a generator; no parameter is ever missing.
#[derive(Debug)]
pub(crate) struct RandomInit<'a, R: ?Sized> {
    pub(crate) rng: &'a mut R,
    pub(crate) device: &'a Device,
}

impl<R: Rng + ?Sized> ParamSource for RandomInit<'_, R> {
    type Error = Infallible;

    fn param<const D: usize>(&mut self, _: &str, shape: [usize; D], init: Init) -> Result<Tensor<D>, Infallible> {
        let numbers: usize = shape.iter().product();
        let values = match init {
            Init::Zeros => vec![0.0; numbers],
            Init::Ones => vec![1.0; numbers],
            Init::Orthogonal(gain) => orthogonal(shape[0], shape[1..].iter().product(), gain, self.rng),
            Init::Uniform(bound) => uniform(numbers, bound, self.rng),
        };
        Ok(Tensor::from_data(TensorData::new(values, shape), self.device))
    }
}

//! Where the numbers of a network come from when it is made: from a generator, or out of a file.

use super::init::{orthogonal, uniform};
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;
use std::convert::Infallible;

/// What a parameter of a fresh network starts with.
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

/// Gives a network its parameters while it is made.
///
/// The function that makes a network is the only place that knows its sizes: from a generator it makes a fresh network,
/// from a file the stored one, and a file that does not hold what its header describes is refused at the first tensor,
/// before anything of a size that only the header knows is made. Sizes may come from such a header, so that sums and
/// products of them saturate.
pub(crate) trait ParamSource {
    /// Why a parameter cannot be had.
    type Error;

    /// The parameter called `name`, of `shape`.
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

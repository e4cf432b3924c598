//! Named parameters: a visitor over the tensors of a network.

use crate::LearnError;
use burn::tensor::{Device, Tensor};

/// A function that is applied to each parameter of a network in turn.
pub trait ParamVisitor {
    /// Visits a parameter. Called once per parameter, always in the same order. `name` is unique in the network.
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>);
}

/// A network (or a part of one) that can name its parameters.
pub trait Parameters {
    /// Calls `visitor` with every parameter; `prefix` (may be empty) goes before each name.
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V);
}

/// Returns `prefix.name`, or `name` without a prefix.
pub(crate) fn path(prefix: &str, name: &str) -> String {
    if prefix.is_empty() { name.to_owned() } else { format!("{prefix}.{name}") }
}

struct Track;

impl ParamVisitor for Track {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        *tensor = tensor.clone().inner().autodiff().require_grad();
    }
}

struct Freeze;

impl ParamVisitor for Freeze {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        *tensor = tensor.clone().inner();
    }
}

/// Returns a copy of `network` whose parameters receive gradients. The numbers are shared, not copied.
pub fn tracked<M: Parameters + Clone>(network: &M) -> M {
    let mut copy = network.clone();
    copy.visit("", &mut Track);
    copy
}

/// Returns a copy of `network` for inference, outside of any gradient graph. The numbers are shared, not copied.
pub fn frozen<M: Parameters + Clone>(network: &M) -> M {
    let mut copy = network.clone();
    copy.visit("", &mut Freeze);
    copy
}

struct Move<'a>(&'a Device, Option<LearnError>);

impl ParamVisitor for Move<'_> {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        match tensor.clone().inner().try_into_data() {
            Ok(numbers) => *tensor = Tensor::from_data(numbers, self.0),
            Err(error) => self.1 = Some(LearnError::Device(error.to_string())),
        }
    }
}

/// Returns a copy with the same weights on `device`, without gradients.
///
/// # Errors
/// [`LearnError::Device`] if they cannot be read.
pub(crate) fn moved<M: Parameters + Clone>(network: &M, device: &Device) -> Result<M, LearnError> {
    let mut copy = network.clone();
    let mut visitor = Move(device, None);
    copy.visit("", &mut visitor);
    visitor.1.map_or(Ok(copy), Err)
}

struct Count(usize);

impl ParamVisitor for Count {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        self.0 += tensor.dims().iter().product::<usize>();
    }
}

/// Returns how many numbers the parameters of `network` hold.
pub fn parameter_count<M: Parameters + Clone>(network: &M) -> usize {
    let mut count = Count(0);
    network.clone().visit("", &mut count);
    count.0
}

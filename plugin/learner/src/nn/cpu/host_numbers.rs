//! Reading the numbers of a tensor where they are.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Flex};
use std::borrow::Cow;

/// A backend whose numbers can be read without a copy.
pub(super) trait HostNumbers: Backend {
    /// The numbers, row-major.
    fn numbers(tensor: &FloatTensor<Self>) -> Cow<'_, [f32]>;
}

impl HostNumbers for Flex {
    fn numbers(tensor: &FloatTensor<Self>) -> Cow<'_, [f32]> {
        let copy = || tensor.to_contiguous().as_slice().map(<[f32]>::to_vec);
        let values = tensor.as_slice().map(Cow::Borrowed).or_else(|| copy().map(Cow::Owned));
        values.expect("a tensor in row-major order can be read")
    }
}

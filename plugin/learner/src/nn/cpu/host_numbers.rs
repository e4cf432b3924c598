//! Conversion between tensors and numbers in host memory.

#![allow(deprecated, reason = "ndarray is kept as a second opinion on flex")]

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, DispatchDevice, Flex, NdArray};
use burn::tensor::{Device, Shape, TensorData, read_sync};
use std::borrow::Cow;

/// Returns whether the numbers of `device` lie in host memory, where reading them costs nothing.
pub(crate) fn is_host(device: &Device) -> bool {
    matches!(device.clone().inner().as_dispatch(), DispatchDevice::Flex(_) | DispatchDevice::NdArray(_))
}

/// A backend whose numbers can be read, without a copy if possible.
pub(super) trait HostNumbers: Backend {
    /// Returns the numbers, row-major.
    fn numbers(tensor: &FloatTensor<Self>) -> Cow<'_, [f32]>;
}

impl HostNumbers for Flex {
    fn numbers(tensor: &FloatTensor<Self>) -> Cow<'_, [f32]> {
        let copy = || tensor.to_contiguous().as_slice().map(<[f32]>::to_vec);
        let values = tensor.as_slice().map(Cow::Borrowed).or_else(|| copy().map(Cow::Owned));
        values.expect("a tensor in row-major order can be read")
    }
}

impl HostNumbers for NdArray {
    fn numbers(tensor: &FloatTensor<Self>) -> Cow<'_, [f32]> {
        let data = data::<Self>(tensor.clone());
        Cow::Owned(data.into_vec().expect("tensors are made of f32"))
    }
}

/// Returns the numbers of a tensor in host memory; copies only if they are shared.
pub(super) fn data<B: Backend>(tensor: FloatTensor<B>) -> TensorData {
    read_sync(B::float_into_data(tensor)).expect("a backend with kernels has its numbers in host memory")
}

/// Creates a tensor of `values`.
pub(super) fn tensor<B: Backend>(values: Vec<f32>, shape: impl Into<Shape>, device: &B::Device) -> FloatTensor<B> {
    B::float_from_data(TensorData::new(values, shape), device)
}

//! Between flat host memory and tensors.

use crate::LearnError;
use burn::tensor::{Device, Tensor, TensorData};

/// A `[rows, width]` tensor.
pub(crate) fn matrix(values: Vec<f32>, rows: usize, width: usize, device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(values, [rows, width]), device)
}

/// A `[len]` tensor.
pub(crate) fn vector(values: Vec<f32>, device: &Device) -> Tensor<1> {
    let len = values.len();
    Tensor::from_data(TensorData::new(values, [len]), device)
}

/// The numbers of a tensor, row-major.
pub(crate) fn host<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, LearnError> {
    tensor.try_into_vec_as::<f32>().map_err(|e| LearnError::Device(e.to_string()))
}

/// The number of a tensor of one element.
pub(crate) fn scalar(tensor: Tensor<1>) -> Result<f32, LearnError> {
    tensor.try_into_scalar::<f32>().map_err(|e| LearnError::Device(e.to_string()))
}

/// The number of a `[1]` tensor, tracked or not, which must be finite; `steps` optimizer steps were done before.
pub(crate) fn finite(name: &str, tensor: &Tensor<1>, steps: u64) -> Result<f64, LearnError> {
    let value = scalar(tensor.clone().inner())?;
    if value.is_finite() {
        return Ok(f64::from(value));
    }
    Err(LearnError::NotFinite { tensor: name.to_owned(), steps })
}

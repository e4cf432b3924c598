//! Conversion between flat host memory and tensors.

use crate::LearnError;
use burn::tensor::{Device, Tensor, TensorData};

/// Creates a `[rows, width]` tensor.
pub(crate) fn matrix(values: Vec<f32>, rows: usize, width: usize, device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(values, [rows, width]), device)
}

/// Creates a `[len]` tensor.
pub(crate) fn vector(values: Vec<f32>, device: &Device) -> Tensor<1> {
    let len = values.len();
    Tensor::from_data(TensorData::new(values, [len]), device)
}

/// Returns the numbers of a tensor, row-major.
pub(crate) fn host<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, LearnError> {
    tensor.try_into_vec_as::<f32>().map_err(|e| LearnError::Device(e.to_string()))
}

/// Returns the number of a tensor of one element.
pub(crate) fn scalar(tensor: Tensor<1>) -> Result<f32, LearnError> {
    tensor.try_into_scalar::<f32>().map_err(|e| LearnError::Device(e.to_string()))
}

/// Value beyond which a loss has exploded: single precision cannot resolve its changes.
const EXPLODED: f32 = 1e12;

/// Returns the number of a `[1]` tensor, tracked or not, which must be finite and not have exploded; `steps`
/// optimizer steps were done before.
pub(crate) fn finite(name: &str, tensor: &Tensor<1>, steps: u64) -> Result<f64, LearnError> {
    let value = scalar(tensor.clone().inner())?;
    check_loss(name, value, steps)?;
    Ok(f64::from(value))
}

/// Checks that a loss is finite and has not exploded.
pub(crate) fn check_loss(name: &str, value: f32, steps: u64) -> Result<(), LearnError> {
    let tensor = name.to_owned();
    match value {
        value if !value.is_finite() => Err(LearnError::NotFinite { tensor, steps: Some(steps) }),
        value if value.abs() > EXPLODED => Err(LearnError::Exploded { tensor, value, steps }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_that_ran_away_are_named() {
        assert!(check_loss("loss", -1e9, 7).is_ok());
        for (value, words) in [(f32::NAN, "`loss` is not finite after 7"), (-1e13, "`loss` has exploded: it is -1e13")]
        {
            let error = check_loss("loss", value, 7).expect_err("ran away");
            assert!(error.is_divergence() && error.to_string().contains(words), "{error}");
        }
    }
}

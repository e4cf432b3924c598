//! Observations on a device.

use super::{PackedPixels, matrix};
use crate::device::is_host;
use crate::{ObsKind, Observations};
use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;

/// A batch of observations on a device, one per row.
#[derive(Clone, Debug)]
pub enum ObsBatch {
    /// `[n, width]`.
    Vector(Tensor<2>),
    /// Pixels divided by 255, `[n, channels, height, width]`.
    Image(Tensor<4>),
}

impl ObsBatch {
    /// Moves whole observations of `kind` to `device`.
    pub(crate) fn new(observations: Observations, kind: &ObsKind, device: &Device) -> Self {
        let rows = observations.numbers() / kind.numbers().max(1);
        match (observations, kind) {
            (Observations::Vector(values), _) => Self::Vector(matrix(values, rows, kind.numbers(), device)),
            (Observations::Image(pixels), ObsKind::Image(shape)) => {
                Self::pixels(pixels, [rows, shape.channels, shape.height, shape.width], device)
            }
            (Observations::Image(_), ObsKind::Vector(_)) => {
                unreachable!("observations are checked to be of their kind")
            }
        }
    }

    /// Creates images from their pixels, row-major in `shape` = `[n, channels, height, width]`.
    ///
    /// # Panics
    /// If the number of pixels does not match the shape.
    pub fn pixels(pixels: Vec<u8>, shape: [usize; 4], device: &Device) -> Self {
        let [rows, sides @ ..] = shape;
        Self::Image(Self::gather(&pixels, sides, &(0..rows).collect::<Vec<_>>(), device))
    }

    /// Returns the tensor of [`Self::pixels`] for some `rows` of many images of `sides` = `[channels, height,
    /// width]`: from the bytes to the numbers in one pass.
    ///
    /// # Panics
    /// If a row does not exist.
    pub(crate) fn gather(pixels: &[u8], sides: [usize; 3], rows: &[usize], device: &Device) -> Tensor<4> {
        let [channels, height, width] = sides;
        let size = channels * height * width;
        if !is_host(device) {
            let bytes: Vec<u8> = rows.iter().flat_map(|&row| &pixels[row * size..(row + 1) * size]).copied().collect();
            return PackedPixels::send(&bytes, sides, device).numbers();
        }
        let mut numbers = vec![0.0f32; rows.len() * size];
        numbers.par_chunks_mut(size.max(1)).zip(rows).for_each(|(image, &row)| {
            let bytes = &pixels[row * size..(row + 1) * size];
            image.iter_mut().zip(bytes).for_each(|(x, &byte)| *x = f32::from(byte) / 255.0);
        });
        Tensor::from_data(TensorData::new(numbers, [rows.len(), channels, height, width]), device)
    }

    /// Returns the number of observations.
    pub fn rows(&self) -> usize {
        match self {
            Self::Vector(x) => x.dims()[0],
            Self::Image(x) => x.dims()[0],
        }
    }

    /// Returns the first `n` observations.
    pub fn first(&self, n: usize) -> Self {
        match self {
            Self::Vector(x) => Self::Vector(x.clone().narrow(0, 0, n)),
            Self::Image(x) => Self::Image(x.clone().narrow(0, 0, n)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::host;

    #[test]
    fn rows_of_bytes_become_numbers_from_0_to_1() {
        let bytes: Vec<u8> = (0..=255).collect();
        for kind in DeviceKind::CPU {
            let device = kind.plain();
            let x = ObsBatch::gather(&bytes, [2, 4, 8], &[3, 0, 3], &device);
            assert_eq!(x.dims(), [3, 2, 4, 8]);
            let want: Vec<f32> =
                [3, 0, 3].iter().flat_map(|row| row * 64..row * 64 + 64).map(|i| i as f32 / 255.0).collect();
            assert_eq!(host(x).expect("readable"), want);
            let whole = ObsBatch::pixels(bytes.clone(), [4, 2, 4, 8], &device);
            assert_eq!(whole.rows(), 4);
        }
    }
}

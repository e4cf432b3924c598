//! Observations on a device.

use super::matrix;
use crate::{ObsKind, Observations};
use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;

/// Pixels that one thread takes at a time.
const CHUNK: usize = 1 << 14;

/// A batch of observations on a device, one per row.
#[derive(Clone, Debug)]
pub enum ObsRows {
    /// `[n, width]`.
    Vector(Tensor<2>),
    /// Pixels divided by 255, `[n, channels, height, width]`.
    Image(Tensor<4>),
}

impl ObsRows {
    /// Moves whole observations of `kind` to `device`. Pixels become numbers on the way.
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

    /// Images from their pixels, row-major in `shape` = `[n, channels, height, width]`.
    ///
    /// # Panics
    /// If the number of pixels is not that of the shape.
    pub fn pixels(pixels: Vec<u8>, shape: [usize; 4], device: &Device) -> Self {
        Self::Image(Self::scaled(pixels, shape, device))
    }

    /// The tensor of [`Self::pixels`].
    pub(crate) fn scaled(pixels: Vec<u8>, shape: [usize; 4], device: &Device) -> Tensor<4> {
        let mut values = vec![0.0; pixels.len()];
        let chunks = values.par_chunks_mut(CHUNK).zip(pixels.par_chunks(CHUNK));
        chunks.for_each(|(values, pixels)| {
            values.iter_mut().zip(pixels).for_each(|(value, &pixel)| *value = f32::from(pixel) / 255.0);
        });
        Tensor::from_data(TensorData::new(values, shape), device)
    }

    /// Number of observations.
    pub fn rows(&self) -> usize {
        match self {
            Self::Vector(x) => x.dims()[0],
            Self::Image(x) => x.dims()[0],
        }
    }

    /// The first `n`.
    pub fn first(&self, n: usize) -> Self {
        match self {
            Self::Vector(x) => Self::Vector(x.clone().narrow(0, 0, n)),
            Self::Image(x) => Self::Image(x.clone().narrow(0, 0, n)),
        }
    }
}

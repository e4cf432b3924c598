//! Convolution and pooling over images `[n, channels, height, width]`.

use super::cpu::trunk::Conv;
pub use super::cpu::trunk::window_places;
use super::params::{ParamVisitor, Parameters, path};
use super::source::{Init, ParamSource, RandomInit};
use burn::tensor::module::{conv2d, max_pool2d};
use burn::tensor::ops::{ConvOptions, MaxPoolOptions};
use burn::tensor::{Device, Tensor};
use rand::Rng;

/// A two-dimensional convolution (cross-correlation) with a square kernel.
#[derive(Clone, Debug)]
pub struct Conv2d {
    /// `[outputs, inputs, kernel, kernel]`.
    pub weight: Tensor<4>,
    /// `[outputs]`.
    pub bias: Tensor<1>,
    /// Pixels from one position of the kernel to the next.
    pub stride: usize,
    /// Zeros around the image.
    pub padding: usize,
}

impl Conv2d {
    /// Creates a layer of `inputs` to `outputs` channels, stride 1, no padding. Orthogonal weights times `gain` (one
    /// row of the matrix per output channel), zero bias.
    pub fn new<R: Rng + ?Sized>(
        inputs: usize,
        outputs: usize,
        kernel: usize,
        gain: f64,
        rng: &mut R,
        device: &Device,
    ) -> Self {
        let Ok(layer) = Self::build(&mut RandomInit { rng, device }, "", inputs, outputs, kernel, gain);
        layer
    }

    /// Creates a layer as [`Self::new`], with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        inputs: usize,
        outputs: usize,
        kernel: usize,
        gain: f64,
    ) -> Result<Self, S::Error> {
        let shape = [outputs, inputs, kernel, kernel];
        Ok(Self {
            weight: source.param(&path(prefix, "weight"), shape, Init::Orthogonal(gain))?,
            bias: source.param(&path(prefix, "bias"), [outputs], Init::Zeros)?,
            stride: 1,
            padding: 0,
        })
    }

    /// Sets another stride.
    pub fn with_stride(self, stride: usize) -> Self {
        Self { stride, ..self }
    }

    /// Sets the zeros around the image.
    pub fn with_padding(self, padding: usize) -> Self {
        Self { padding, ..self }
    }

    /// Returns the layer as the kernels read it.
    pub(super) fn view(&self) -> Conv<'_> {
        Conv { weight: &self.weight, bias: &self.bias, stride: self.stride, padding: self.padding }
    }

    /// Maps `[n, inputs, height, width]` to `[n, outputs, height', width']`, each side by [`window_places`].
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let options = ConvOptions::new([self.stride; 2], [self.padding; 2], [1; 2], 1);
        conv2d(x, self.weight.clone(), Some(self.bias.clone()), options)
    }
}

impl Parameters for Conv2d {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        visitor.visit(&path(prefix, "weight"), &mut self.weight);
        visitor.visit(&path(prefix, "bias"), &mut self.bias);
    }
}

/// Returns the largest number in each square of `kernel` pixels; padding is never the largest.
pub fn max_pool(x: Tensor<4>, kernel: usize, stride: usize, padding: usize) -> Tensor<4> {
    let options = MaxPoolOptions::new([kernel; 2]).with_stride([stride; 2]).with_padding([padding; 2]);
    max_pool2d(x, options)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::{host, vector};
    use crate::rng::Streams;
    use burn::tensor::TensorData;

    #[test]
    fn a_convolution_by_hand() {
        for kind in DeviceKind::CPU {
            let device = kind.plain();
            let mut conv = Conv2d::new(1, 1, 2, 1.0, &mut Streams::new(1).stream("c", 0), &device).with_stride(2);
            conv.weight = Tensor::from_data(TensorData::new(vec![1.0f32, 10.0, 100.0, 1000.0], [1, 1, 2, 2]), &device);
            conv.bias = vector(vec![0.5], &device);
            let x = Tensor::from_data(TensorData::new((0..16).map(|i| i as f32).collect(), [1, 1, 4, 4]), &device);
            // The corners of the four squares: 0 1 4 5 | 2 3 6 7 | 8 9 12 13 | 10 11 14 15.
            let y = conv.forward(x.clone());
            assert_eq!(host(y).expect("readable"), [5410.5, 7632.5, 14298.5, 16520.5]);
            // Of the padded pooling windows the first sees 0 1 4 5, the last 5 6 7 9 10 11 13 14 15.
            let pooled = max_pool(x.neg(), 3, 2, 1);
            assert_eq!(pooled.dims(), [1, 1, 2, 2]);
            assert_eq!(host(pooled).expect("readable"), [0.0, -1.0, -4.0, -5.0]);
        }
    }

    #[test]
    fn windows_must_fit() {
        assert_eq!(window_places(64, 3, 2, 1), Some(32));
        assert_eq!(window_places(7, 8, 4, 0), None);
        assert_eq!(window_places(8, 8, 4, 0), Some(1));
    }
}

//! The image encoder of the first deep Q-network.

use super::conv::{Conv2d, window_places};
use super::cpu::trunk::{self, Stage};
use super::image_net::last_layer;
use super::params::{ParamVisitor, Parameters, path};
use super::source::{ParamSource, RandomInit};
use super::{Activation, Linear};
use crate::ImageShape;
use burn::tensor::{Device, Tensor};
use rand::Rng;
use std::f64::consts::SQRT_2;

/// The size of a convolution.
struct ConvSize {
    /// Output channels.
    channels: usize,
    /// Rows and columns of the kernel.
    kernel: usize,
    stride: usize,
}

const LAYERS: [ConvSize; 3] = [
    ConvSize { channels: 32, kernel: 8, stride: 4 },
    ConvSize { channels: 64, kernel: 4, stride: 2 },
    ConvSize { channels: 64, kernel: 3, stride: 1 },
];

/// Three convolutions and a linear layer, ReLU after each (Mnih et al. 2015, "Human-level control through deep
/// reinforcement learning"). Several times cheaper than [`super::Impala`].
#[derive(Clone, Debug)]
pub struct Nature {
    /// The convolutions: 32 channels of 8×8 at every 4th pixel, 64 of 4×4 at every 2nd, 64 of 3×3.
    pub convs: Vec<Conv2d>,
    /// The last layer, over the last convolution's channels, rows and columns.
    pub fc: Linear,
}

impl Nature {
    /// Creates a network with orthogonal weights with gain √2. Returns `None` if the image is too small for the
    /// kernels: a side needs 36 pixels.
    pub fn new<R: Rng + ?Sized>(feature: usize, image: ImageShape, rng: &mut R, device: &Device) -> Option<Self> {
        if !Self::fits(image) {
            return None;
        }
        let Ok(net) = Self::build(&mut RandomInit { rng, device }, "", feature, image);
        Some(net)
    }

    /// Returns whether an image is large enough for the kernels.
    pub(crate) fn fits(image: ImageShape) -> bool {
        places(image.height).is_some() && places(image.width).is_some()
    }

    /// Creates a network as [`Self::new`], with parameters out of `source`. For an image that is too small the last
    /// layer has no inputs.
    pub(crate) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        feature: usize,
        image: ImageShape,
    ) -> Result<Self, S::Error> {
        let mut inputs = image.channels;
        let mut convs = Vec::with_capacity(LAYERS.len());
        for (i, ConvSize { channels, kernel, stride }) in LAYERS.into_iter().enumerate() {
            let conv = Conv2d::build(source, &path(prefix, &format!("conv{i}")), inputs, channels, kernel, SQRT_2)?;
            convs.push(conv.with_stride(stride));
            inputs = channels;
        }
        let sides = places(image.height).unwrap_or(0).saturating_mul(places(image.width).unwrap_or(0));
        let fc = Linear::build(source, &path(prefix, "fc"), inputs.saturating_mul(sides), feature, SQRT_2)?;
        Ok(Self { convs, fc })
    }

    /// Maps pixels in 0..1, `[n, channels, height, width]`, to features `[n, feature]`, none negative.
    pub fn forward(&self, pixels: Tensor<4>) -> Tensor<2> {
        let stages: Vec<Stage<'_>> = self.convs.iter().map(|conv| Stage::Relu(conv.view())).collect();
        let flat = trunk::features(&pixels, &stages).unwrap_or_else(|| {
            let x = self.convs.iter().fold(pixels, |x, conv| Activation::Relu.forward(conv.forward(x)));
            x.flatten(1, 3)
        });
        last_layer(&self.fc, flat)
    }
}

/// Returns the positions of the last convolution along a side of `size` pixels.
fn places(size: usize) -> Option<usize> {
    LAYERS.into_iter().try_fold(size, |size, layer| window_places(size, layer.kernel, layer.stride, 0))
}

impl Parameters for Nature {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        for (i, conv) in self.convs.iter_mut().enumerate() {
            conv.visit(&path(prefix, &format!("conv{i}")), visitor);
        }
        self.fc.visit(&path(prefix, "fc"), visitor);
    }
}

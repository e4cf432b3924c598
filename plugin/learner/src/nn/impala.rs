//! The image encoder of IMPALA.

use super::conv::{Conv2d, max_pool, window_places};
use super::cpu::trunk::{self, Stage};
use super::image_net::last_layer;
use super::params::{ParamVisitor, Parameters, path};
use super::source::{ParamSource, RandomInit};
use super::{Activation, Linear};
use crate::ImageShape;
use burn::tensor::{Device, Tensor};
use rand::Rng;
use std::f64::consts::SQRT_2;

/// Stages of convolution, pooling and residual blocks, then a linear layer (Espeholt et al. 2018, "IMPALA", the larger
/// of its two networks, without its recurrent part).
#[derive(Clone, Debug)]
pub struct Impala {
    /// The stages, from the image up; each halves the sides.
    pub stages: Vec<ImpalaStage>,
    /// The last layer, over the last stage's channels, rows and columns.
    pub fc: Linear,
}

/// A 3×3 convolution, max-pooling of 3×3 at every second pixel, and two residual blocks.
#[derive(Clone, Debug)]
pub struct ImpalaStage {
    /// Changes the number of channels.
    pub conv: Conv2d,
    /// The residual blocks.
    pub blocks: [ResidualBlock; 2],
}

/// x + conv1(relu(conv0(relu(x)))), both convolutions 3×3.
#[derive(Clone, Debug)]
pub struct ResidualBlock {
    /// The first convolution.
    pub conv0: Conv2d,
    /// The second.
    pub conv1: Conv2d,
}

impl Impala {
    /// Creates one stage per entry of `channels`. Orthogonal weights with gain 1 in the convolutions (with √2 each
    /// residual block would double the variance) and √2 in the last layer.
    pub fn new<R: Rng + ?Sized>(
        channels: &[usize],
        feature: usize,
        image: ImageShape,
        rng: &mut R,
        device: &Device,
    ) -> Self {
        let Ok(net) = Self::build(&mut RandomInit { rng, device }, "", channels, feature, image);
        net
    }

    /// Creates a network as [`Self::new`], with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        channels: &[usize],
        feature: usize,
        image: ImageShape,
    ) -> Result<Self, S::Error> {
        let (mut inputs, mut height, mut width) = (image.channels, image.height, image.width);
        let mut stages = Vec::with_capacity(channels.len());
        // A side never becomes shorter than one pixel.
        let pooled = |side: usize| window_places(side, 3, 2, 1).unwrap_or(1);
        for (i, &outputs) in channels.iter().enumerate() {
            stages.push(ImpalaStage::build(source, &path(prefix, &format!("s{i}")), inputs, outputs)?);
            (inputs, height, width) = (outputs, pooled(height), pooled(width));
        }
        let flat = inputs.saturating_mul(height).saturating_mul(width);
        Ok(Self { stages, fc: Linear::build(source, &path(prefix, "fc"), flat, feature, SQRT_2)? })
    }

    /// Maps pixels in 0..1, `[n, channels, height, width]`, to features `[n, feature]`, none negative.
    pub fn forward(&self, pixels: Tensor<4>) -> Tensor<2> {
        let stages: Vec<Stage<'_>> = self.stages.iter().flat_map(ImpalaStage::of_trunk).collect();
        let flat = trunk::features(&pixels, &stages).unwrap_or_else(|| {
            let x = self.stages.iter().fold(pixels, |x, stage| stage.forward(x));
            Activation::Relu.forward(x).flatten(1, 3)
        });
        last_layer(&self.fc, flat)
    }
}

impl ImpalaStage {
    fn build<S: ParamSource>(source: &mut S, prefix: &str, inputs: usize, outputs: usize) -> Result<Self, S::Error> {
        let mut conv = |name: &str, inputs| -> Result<Conv2d, S::Error> {
            Ok(Conv2d::build(source, &path(prefix, name), inputs, outputs, 3, 1.0)?.with_padding(1))
        };
        let first = conv("conv", inputs)?;
        let mut block = |name: &str| -> Result<ResidualBlock, S::Error> {
            Ok(ResidualBlock {
                conv0: conv(&path(name, "conv0"), outputs)?,
                conv1: conv(&path(name, "conv1"), outputs)?,
            })
        };
        Ok(Self { conv: first, blocks: [block("res0")?, block("res1")?] })
    }

    fn of_trunk(&self) -> [Stage<'_>; 3] {
        let [block0, block1] = &self.blocks;
        let [second, third] = [block0, block1].map(|block| Stage::Residual(block.conv0.view(), block.conv1.view()));
        [Stage::Pool(self.conv.view()), second, third]
    }

    /// Maps `[n, inputs, height, width]` to `[n, outputs, ⌈height/2⌉, ⌈width/2⌉]`.
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let pooled = max_pool(self.conv.forward(x), 3, 2, 1);
        self.blocks.iter().fold(pooled, |x, block| block.forward(x))
    }
}

impl ResidualBlock {
    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let inner = self.conv0.forward(Activation::Relu.forward(x.clone()));
        x + self.conv1.forward(Activation::Relu.forward(inner))
    }
}

impl Parameters for Impala {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        for (i, stage) in self.stages.iter_mut().enumerate() {
            let name = path(prefix, &format!("s{i}"));
            stage.conv.visit(&path(&name, "conv"), visitor);
            for (k, block) in stage.blocks.iter_mut().enumerate() {
                let name = path(&name, &format!("res{k}"));
                block.conv0.visit(&path(&name, "conv0"), visitor);
                block.conv1.visit(&path(&name, "conv1"), visitor);
            }
        }
        self.fc.visit(&path(prefix, "fc"), visitor);
    }
}

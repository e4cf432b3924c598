//! The network that turns images into features, of either architecture.

use crate::{
    ImageShape, LearnError, ObsKind,
    nn::{
        Linear,
        conv::{Conv2d, max_pool},
        params::{ParamSource, ParamVisitor, Parameters, RandomInit, path},
    },
    settings::{Number, Numbers},
};
use burn::tensor::{Device, Tensor};
use playbot_kernels::{
    elementwise::Activation,
    trunk,
    trunk::{TrunkStage, grid::window_places},
};
use rand::Rng;
use serde::{Deserialize, Serialize};
use std::f64::consts::SQRT_2;

/// Architecture and sizes of an [`ImageNet`].
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub enum CnnKind {
    /// The residual network of IMPALA, the paper's.
    Impala {
        /// Channels of each stage.
        #[serde(default = "impala_channels")]
        channels: Vec<usize>,
        /// Number of features.
        #[serde(default = "impala_feature")]
        feature: usize,
    },
    /// The three convolutions of the first deep Q-network; needs images of at least 36×36 pixels.
    Nature {
        /// Number of features.
        #[serde(default = "nature_feature")]
        feature: usize,
    },
}

fn impala_channels() -> Vec<usize> {
    vec![16, 32, 32]
}

fn impala_feature() -> usize {
    256
}

fn nature_feature() -> usize {
    512
}

impl Default for CnnKind {
    fn default() -> Self {
        Self::Impala { channels: impala_channels(), feature: impala_feature() }
    }
}

impl Numbers for CnnKind {
    fn numbers(&self) -> Vec<Number> {
        vec![Number::Whole(self.smallest() as u64)]
    }
}

impl CnnKind {
    /// Returns the number of features of an image.
    pub fn features(&self) -> usize {
        match self {
            Self::Impala { feature, .. } | Self::Nature { feature } => *feature,
        }
    }

    /// Returns the smallest of the sizes, which must not be 0.
    pub(crate) fn smallest(&self) -> usize {
        match self {
            Self::Impala { channels, feature } => channels.iter().copied().min().unwrap_or(1).min(*feature),
            Self::Nature { feature } => *feature,
        }
    }

    /// Checks that such a network can read such images.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the image is too small for the architecture, or a size is 0.
    pub(crate) fn check_image(&self, image: ImageShape) -> Result<(), LearnError> {
        let kind = ObsKind::Image(image);
        if image.numbers() == 0 || self.smallest() == 0 {
            return Err(LearnError::Config(format!("a cnn {self:?} over {kind} has a size of 0")));
        }
        if matches!(self, Self::Nature { .. }) && !Nature::fits(image) {
            return Err(LearnError::Config(format!("cnn Nature needs at least 36 rows and columns, not {kind}")));
        }
        Ok(())
    }
}

/// A network from images to features.
#[derive(Clone, Debug)]
pub enum ImageNet {
    /// The residual network of IMPALA.
    Impala(Impala),
    /// The network of the first deep Q-network.
    Nature(Nature),
}

impl ImageNet {
    /// Creates a network with orthogonal starting weights, for images of `image`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the image is too small for the architecture, or a size is 0.
    pub fn new<R: Rng + ?Sized>(
        kind: &CnnKind,
        image: ImageShape,
        rng: &mut R,
        device: &Device,
    ) -> Result<Self, LearnError> {
        kind.check_image(image)?;
        let Ok(net) = Self::build(&mut RandomInit { rng, device }, "", kind, image);
        Ok(net)
    }

    /// Creates a network as [`Self::new`], with parameters out of `source`, for images that [`CnnKind::check_image`]
    /// allows or the source refuses.
    pub(crate) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        kind: &CnnKind,
        image: ImageShape,
    ) -> Result<Self, S::Error> {
        Ok(match kind {
            CnnKind::Impala { channels, feature } => {
                Self::Impala(Impala::build(source, prefix, channels, *feature, image)?)
            }
            CnnKind::Nature { feature } => Self::Nature(Nature::build(source, prefix, *feature, image)?),
        })
    }

    /// Returns architecture and sizes.
    pub fn kind(&self) -> CnnKind {
        let feature = self.features();
        match self {
            Self::Impala(net) => {
                let channels = net.stages.iter().map(|stage| stage.conv.weight.dims()[0]).collect();
                CnnKind::Impala { channels, feature }
            }
            Self::Nature(_) => CnnKind::Nature { feature },
        }
    }

    /// Returns the number of features of an image.
    pub fn features(&self) -> usize {
        let [_, features] = self.fc().weight.dims();
        features
    }

    /// Maps pixels in 0..1, `[n, channels, height, width]`, to features `[n, features]`. Gradients reach the
    /// parameters, not the pixels.
    pub fn forward(&self, pixels: Tensor<4>) -> Tensor<2> {
        match self {
            Self::Impala(net) => net.forward(pixels),
            Self::Nature(net) => net.forward(pixels),
        }
    }

    /// Returns the number of 64×64 images per batch of learning: the activations kept for their gradient stay below a
    /// hundred megabytes.
    pub(crate) fn images_at_a_time(&self) -> usize {
        match self {
            // 0.7 MB per image with 80 channels in all.
            Self::Impala(net) => {
                let channels: usize = net.stages.iter().map(|stage| stage.conv.weight.dims()[0]).sum();
                (128 * 80 / channels.max(1)).clamp(16, 1024)
            }
            // 0.1 MB per image.
            Self::Nature(_) => 1024,
        }
    }

    /// Returns the most numbers that a layer makes of an image of `sides` = `[channels, height, width]`, or reads.
    pub(crate) fn widest(&self, sides: [usize; 3]) -> usize {
        let [channels, height, width] = sides;
        let first = match self {
            // The first convolution leaves height and width as they are.
            Self::Impala(net) => net.stages.first().map_or(0, |stage| stage.conv.weight.dims()[0]),
            // The first convolution halves them twice, for 32 channels at most.
            Self::Nature(_) => 2,
        };
        channels.max(first) * height * width
    }

    fn fc(&self) -> &Linear {
        match self {
            Self::Impala(net) => &net.fc,
            Self::Nature(net) => &net.fc,
        }
    }
}

/// Returns the ReLU of `fc` over the channels, rows and columns of images, in this order.
pub(super) fn last_layer(fc: &Linear, flat: Tensor<2>) -> Tensor<2> {
    let [n, _] = flat.dims();
    // Matrix libraries sum a single row in another order than the rows of a matrix. An image's features must not depend
    // on the others in the batch.
    let flat = if n == 1 { flat.repeat_dim(0, 2) } else { flat };
    fc.activated(flat, Activation::Relu).narrow(0, 0, n)
}

impl Parameters for ImageNet {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        match self {
            Self::Impala(net) => net.visit(prefix, visitor),
            Self::Nature(net) => net.visit(prefix, visitor),
        }
    }
}

// The image encoder of IMPALA.

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
        let stages: Vec<TrunkStage<'_>> = self.stages.iter().flat_map(ImpalaStage::of_trunk).collect();
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

    fn of_trunk(&self) -> [TrunkStage<'_>; 3] {
        let [block0, block1] = &self.blocks;
        let [second, third] =
            [block0, block1].map(|block| TrunkStage::Residual(block.conv0.view(), block.conv1.view()));
        [TrunkStage::Pool(self.conv.view()), second, third]
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

// The image encoder of the first deep Q-network.

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
/// reinforcement learning"). Several times cheaper than [`crate::nn::Impala`].
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
        let stages: Vec<TrunkStage<'_>> = self.convs.iter().map(|conv| TrunkStage::Relu(conv.view())).collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::{ObsBatch, host, parameter_count};
    use crate::rng::Streams;

    fn net(kind: &CnnKind, channels: usize, height: usize, width: usize) -> Result<ImageNet, LearnError> {
        let image = ImageShape { channels, height, width };
        ImageNet::new(kind, image, &mut Streams::new(1).stream("net", 0), &DeviceKind::Flex.plain())
    }

    #[test]
    fn any_size_that_fits_gives_features_of_a_sensible_size() {
        let impala = CnnKind::Impala { channels: vec![4, 8, 8], feature: 24 };
        let nature = CnnKind::Nature { feature: 24 };
        for (kind, channels, height, width) in
            [(&impala, 3, 64, 64), (&impala, 1, 17, 33), (&impala, 2, 1, 1), (&nature, 4, 84, 84), (&nature, 3, 36, 41)]
        {
            let net = net(kind, channels, height, width).expect("it fits");
            let pixels = (0..2 * channels * height * width).map(|i| (i * 37 % 256) as u8).collect();
            let shape = [2, channels, height, width];
            let ObsBatch::Image(x) = ObsBatch::pixels(pixels, shape, &DeviceKind::Flex.plain()) else {
                panic!("made of pixels");
            };
            let features = net.forward(x);
            assert_eq!(features.dims(), [2, net.features()]);
            let features = host(features).expect("readable");
            assert!(features.iter().all(|x| (0.0..100.0).contains(x)), "{features:?}");
            assert!(features.iter().any(|x| *x > 1e-3), "dead from the start: {features:?}");
        }
    }

    #[test]
    fn published_sizes() {
        let count = |kind: CnnKind, side| parameter_count(&net(&kind, 3, side, side).expect("it fits"));
        assert_eq!(count(CnnKind::default(), 64), 622_144);
        // 32·(3·64 + 1) + 64·(32·16 + 1) + 64·(64·9 + 1) + 512·(64·4·4 + 1)
        assert_eq!(count(CnnKind::Nature { feature: 512 }, 64), 600_736);
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        let nature = CnnKind::Nature { feature: 8 };
        let error = net(&nature, 3, 64, 35).expect_err("too narrow").to_string();
        assert!(error.contains("36") && error.contains("35 columns"), "{error}");
        let empty = CnnKind::Impala { channels: vec![16, 0], feature: 8 };
        assert!(matches!(net(&empty, 3, 64, 64), Err(LearnError::Config(_))));
        assert!(matches!(net(&CnnKind::default(), 0, 64, 64), Err(LearnError::Config(_))));
    }

    #[test]
    fn settings_have_defaults_and_no_unknown_names() {
        let kind: CnnKind = serde_json::from_str(r#"{"Impala":{"feature":64}}"#).expect("the rest is default");
        assert_eq!(kind, CnnKind::Impala { channels: vec![16, 32, 32], feature: 64 });
        assert!(serde_json::from_str::<CnnKind>(r#"{"Nature":{"features":64}}"#).is_err());
    }
}

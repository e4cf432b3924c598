//! The network that turns images into features, of either architecture.

use super::params::{ParamVisitor, Parameters};
use super::source::{ParamSource, RandomInit};
use super::{Activation, Impala, Linear, Nature};
use crate::settings::{Number, Numbers};
use crate::{ImageShape, LearnError, ObsKind, among_workers};
use burn::tensor::{Device, Tensor};
use rand::Rng;
use serde::{Deserialize, Serialize};

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
        among_workers(|| match self {
            Self::Impala(net) => net.forward(pixels),
            Self::Nature(net) => net.forward(pixels),
        })
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
    // Matrix libraries sum a single row in another order than the rows of a matrix; an image's features must not
    // depend on the others in the batch.
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

//! Target and predictor of random network distillation.

use crate::{
    FileError, LearnError, ObsKind, Streams,
    file::TensorFile,
    nn::{Activation, CnnKind, ImageNet, Mlp, ObsBatch, ParamSource, ParamVisitor, Parameters, RandomInit, path},
};
use burn::tensor::{Device, Tensor};
use std::convert::Infallible;

/// A network from observations to the numbers that are predicted.
#[derive(Clone, Debug)]
pub struct RndNet {
    /// The convolutions, for images.
    pub cnn: Option<ImageNet>,
    /// The layers behind them.
    pub net: Mlp,
}

impl RndNet {
    /// Maps normalised observations to numbers, `[n, features]`. Values of pixels, too, are normalised ones.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the observations are of the other kind than the network.
    pub fn forward(&self, observations: &ObsBatch) -> Result<Tensor<2>, LearnError> {
        match (&self.cnn, observations) {
            (None, ObsBatch::Vector(x)) => Ok(self.net.forward(x.clone())),
            (Some(cnn), ObsBatch::Image(x)) => Ok(self.net.forward(cnn.forward(x.clone()))),
            _ => Err(LearnError::Config("a network of curiosity got observations of another kind".to_owned())),
        }
    }
}

impl Parameters for RndNet {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        if let Some(cnn) = &mut self.cnn {
            cnn.visit(&path(prefix, "cnn"), visitor);
        }
        self.net.visit(prefix, visitor);
    }
}

/// The network that learns, whose parameters have the names `curiosity.predictor.*`.
#[derive(Clone, Debug)]
pub struct Predictor(
    /// Its layers.
    pub RndNet,
);

impl Parameters for Predictor {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.0.visit(&path(prefix, "curiosity.predictor"), visitor);
    }
}

/// Returns the mean squared error of each row: `[n, features]` twice to `[n]`.
pub fn prediction_errors(predicted: Tensor<2>, wanted: Tensor<2>) -> Tensor<1> {
    (predicted - wanted).square().mean_dim(1).squeeze_dim(1)
}

/// Sizes of target and predictor.
#[derive(Debug)]
pub(super) struct RndShapes {
    pub(super) target: RndShape,
    pub(super) predictor: RndShape,
}

/// Sizes of an [`RndNet`].
#[derive(Debug)]
pub(super) struct RndShape {
    pub(super) obs: ObsKind,
    pub(super) cnn: CnnKind,
    pub(super) hidden: Vec<usize>,
    pub(super) features: usize,
    pub(super) activation: Activation,
}

impl RndShape {
    /// Creates a network with orthogonal starting weights from the stream `name`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if images are too small for the convolutions.
    pub(super) fn fresh(&self, streams: &Streams, name: &str, device: &Device) -> Result<RndNet, LearnError> {
        if let ObsKind::Image(image) = self.obs {
            self.cnn.check_image(image)?;
        }
        let source = &mut RandomInit { rng: &mut streams.stream(name, 0), device };
        let built: Result<RndNet, Infallible> = self.build(source, "");
        let Ok(net) = built;
        Ok(net)
    }

    /// Reads the network called `name` out of a file.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen.
    pub(super) fn stored(&self, file: &mut TensorFile, name: &str, device: &Device) -> Result<RndNet, FileError> {
        if let ObsKind::Image(image) = self.obs {
            file.product(&path(name, "cnn"), &[image.channels, image.height, image.width])?;
        }
        self.build(&mut file.params(device), name)
    }

    fn build<S: ParamSource>(&self, source: &mut S, name: &str) -> Result<RndNet, S::Error> {
        let (cnn, inputs) = match self.obs {
            ObsKind::Vector(width) => (None, width),
            ObsKind::Image(image) => {
                (Some(ImageNet::build(source, &path(name, "cnn"), &self.cnn, image)?), self.cnn.features())
            }
        };
        let net = Mlp::build(source, name, inputs, &self.hidden, self.features, self.activation, 1.0)?;
        Ok(RndNet { cnn, net })
    }
}

//! The network that estimates the return.

use super::NetShape;
use crate::nn::{Mlp, ParamSource, ParamVisitor, Parameters, RandomInit};
use burn::tensor::{Device, Tensor};
use rand::Rng;

/// V(s, z): the actor's input and hidden layers, one output. Of images it reads the features that the actor's trunk makes,
/// which is trained by the losses of both.
#[derive(Clone, Debug)]
pub struct Critic {
    /// Hidden layers and the head.
    pub net: Mlp,
}

impl Critic {
    /// Orthogonal weights, gain √2 in the hidden layers and 1 in the head.
    pub fn new<R: Rng + ?Sized>(shape: &NetShape, rng: &mut R, device: &Device) -> Self {
        let Ok(critic) = Self::build(&mut RandomInit { rng, device }, "", shape);
        critic
    }

    /// [`Self::new`] with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(source: &mut S, prefix: &str, shape: &NetShape) -> Result<Self, S::Error> {
        Ok(Self { net: Mlp::build(source, prefix, shape.inputs(), &shape.hidden, 1, shape.activation, 1.0)? })
    }

    /// Values of joined inputs `[z, s]`: `[n, latent + obs_dim]` to `[n]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<1> {
        let features = self.net.features(x);
        let [width, _] = self.net.head.weight.dims();
        // A product with a single column is summed in an order that depends on the number of rows; this is not.
        let weight = self.net.head.weight.clone().reshape([1, width]);
        (features * weight).sum_dim(1).squeeze_dim(1) + self.net.head.bias.clone()
    }
}

impl Parameters for Critic {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.net.visit(prefix, visitor);
    }
}

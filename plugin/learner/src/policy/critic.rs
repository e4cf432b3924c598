//! The network that estimates the return.

use super::NetShape;
use crate::nn::{Init, Linear, Mlp, ParamSource, ParamVisitor, Parameters, RandomInit, path};
use burn::tensor::{Device, Tensor};
use rand::Rng;

/// V(s, z): the actor's input and hidden layers, one output. For images it reads the features of the actor's trunk,
/// which is trained by the losses of both.
///
/// The value depends on the remaining ticks of the skill. With `clock` it is V(s, z) + c · C(s, z), where c is the
/// [remaining share of its ticks](crate::Rollout::left).
#[derive(Clone, Debug)]
pub struct Critic {
    /// Hidden layers and the head.
    pub net: Mlp,
    /// A second head, C; `None` if ticks are not counted.
    pub clock: Option<Linear>,
}

impl Critic {
    /// Creates a critic with orthogonal weights, gain √2 in the hidden layers and 1 in the head.
    pub fn new<R: Rng + ?Sized>(shape: &NetShape, rng: &mut R, device: &Device) -> Self {
        let Ok(critic) = Self::build(&mut RandomInit { rng, device }, "", shape);
        critic
    }

    /// Creates a critic as [`Self::new`], with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(source: &mut S, prefix: &str, shape: &NetShape) -> Result<Self, S::Error> {
        let net = Mlp::build(source, prefix, shape.inputs(), &shape.hidden, 1, shape.activation, 1.0)?;
        Ok(Self { net, clock: None })
    }

    /// Adds a clock that has no effect yet, or the one of `source`.
    pub(crate) fn with_clock<S: ParamSource>(self, source: &mut S, prefix: &str) -> Result<Self, S::Error> {
        let [width, _] = self.net.head.weight.dims();
        let name = path(prefix, CLOCK);
        let clock = Linear {
            weight: source.param(&path(&name, "weight"), [width, 1], Init::Zeros)?,
            bias: source.param(&path(&name, "bias"), [1], Init::Zeros)?,
        };
        Ok(Self { clock: Some(clock), ..self })
    }

    /// Returns the values of joined inputs `[z, s]`: `[n, latent + obs_dim]` to `[n]`. `left`, `[n]`, is the
    /// remaining share of each skill's ticks; without it all skills count as newly drawn.
    pub fn forward(&self, x: Tensor<2>, left: Option<Tensor<1>>) -> Tensor<1> {
        let features = self.net.features(x);
        let values = number(&self.net.head, features.clone());
        match (&self.clock, left) {
            (Some(clock), Some(left)) => values + number(clock, features) * left,
            (Some(clock), None) => values + number(clock, features),
            (None, _) => values,
        }
    }
}

/// Name of the second head, behind the name of its critic.
pub(crate) const CLOCK: &str = "clock";

/// Returns the one output of a layer, `[n]`.
fn number(layer: &Linear, features: Tensor<2>) -> Tensor<1> {
    let [width, _] = layer.weight.dims();
    // A product with a single column is summed in an order that depends on the number of rows; this is not.
    let weight = layer.weight.clone().reshape([1, width]);
    (features * weight).sum_dim(1).squeeze_dim(1) + layer.bias.clone()
}

impl Parameters for Critic {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.net.visit(prefix, visitor);
        if let Some(clock) = &mut self.clock {
            clock.visit(&path(prefix, CLOCK), visitor);
        }
    }
}

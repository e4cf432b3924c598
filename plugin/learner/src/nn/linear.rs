//! A linear layer.

use super::Activation;
use super::cpu::dense::{Dense, dense};
use super::params::{ParamVisitor, Parameters, path};
use super::source::{Init, ParamSource, RandomInit};
use burn::tensor::{Device, Tensor, module::linear};
use rand::Rng;

/// y = x W + b.
#[derive(Clone, Debug)]
pub struct Linear {
    /// W, `[inputs, outputs]`.
    pub weight: Tensor<2>,
    /// b, `[outputs]`.
    pub bias: Tensor<1>,
}

impl Linear {
    /// Creates a layer with orthogonal weights times `gain` and zero bias.
    pub fn new<R: Rng + ?Sized>(inputs: usize, outputs: usize, gain: f64, rng: &mut R, device: &Device) -> Self {
        let Ok(layer) = Self::build(&mut RandomInit { rng, device }, "", inputs, outputs, gain);
        layer
    }

    /// Creates a layer as [`Self::new`], with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        inputs: usize,
        outputs: usize,
        gain: f64,
    ) -> Result<Self, S::Error> {
        Ok(Self {
            weight: source.param(&path(prefix, "weight"), [inputs, outputs], Init::Orthogonal(gain))?,
            bias: source.param(&path(prefix, "bias"), [outputs], Init::Zeros)?,
        })
    }

    /// Maps `[n, inputs]` to `[n, outputs]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        Self::chain(x, &[(self, None)])
    }

    /// Returns the activation of [`Self::forward`].
    pub fn activated(&self, x: Tensor<2>, activation: Activation) -> Tensor<2> {
        Self::chain(x, &[(self, Some(activation))])
    }

    /// Applies layers, one after the other, with the activation of each.
    pub(super) fn chain(x: Tensor<2>, layers: &[(&Self, Option<Activation>)]) -> Tensor<2> {
        let of_layers = layers.iter().map(|(layer, activation)| {
            let Self { weight, bias } = layer;
            Dense { weight, bias, activation: *activation }
        });
        dense(&x, &of_layers.collect::<Vec<_>>()).unwrap_or_else(|| {
            layers.iter().fold(x, |x, (layer, activation)| match activation {
                Some(activation) => activation.forward(layer.plain(x)),
                None => layer.plain(x),
            })
        })
    }

    /// Applies the layer by the backend's own operations.
    fn plain(&self, x: Tensor<2>) -> Tensor<2> {
        linear(x, self.weight.clone(), Some(self.bias.clone()))
    }

    /// Applies the layer to `[held, x]` without joining the two: `held` is `[B, H]`, `x` is `[steps * B, inputs -
    /// H]`, and row `b` of `held` goes with the rows `t * B + b` of `x`.
    ///
    /// Returns `[steps * B, outputs]`. No gradient is computed for a constant `x`, which saves the largest product of
    /// the backward pass.
    pub fn forward_held(&self, held: Tensor<2>, x: Tensor<2>, steps: usize) -> Tensor<2> {
        let [batch, width] = held.dims();
        let [inputs, outputs] = self.weight.dims();
        let weight = self.weight.clone().slice([width..inputs, 0..outputs]);
        let rest = linear(x, weight, Some(self.bias.clone()));
        if width == 0 {
            return rest;
        }
        let held = held.matmul(self.weight.clone().slice([0..width, 0..outputs])).reshape([1, batch, outputs]);
        (rest.reshape([steps, batch, outputs]) + held).reshape([steps * batch, outputs])
    }
}

impl Parameters for Linear {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        visitor.visit(&path(prefix, "weight"), &mut self.weight);
        visitor.visit(&path(prefix, "bias"), &mut self.bias);
    }
}

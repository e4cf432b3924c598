//! A multi-layer perceptron.

use super::params::{ParamVisitor, Parameters, path};
use super::source::{ParamSource, RandomInit};
use super::{Activation, Linear};
use burn::tensor::{Device, Tensor};
use rand::Rng;
use std::f64::consts::SQRT_2;

/// Hidden layers `l0`, `l1`, ... with an activation after each, then a linear `head`.
#[derive(Clone, Debug)]
pub struct Mlp {
    /// The hidden layers.
    pub layers: Vec<Linear>,
    /// The output layer.
    pub head: Linear,
    /// The function after each hidden layer.
    pub activation: Activation,
}

impl Mlp {
    /// Creates a network with orthogonal weights: gain √2 in the hidden layers, `head_gain` in the head; biases 0.
    pub fn new<R: Rng + ?Sized>(
        inputs: usize,
        hidden: &[usize],
        outputs: usize,
        activation: Activation,
        head_gain: f64,
        rng: &mut R,
        device: &Device,
    ) -> Self {
        let source = &mut RandomInit { rng, device };
        let Ok(net) = Self::build(source, "", inputs, hidden, outputs, activation, head_gain);
        net
    }

    /// Creates a network as [`Self::new`], with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        inputs: usize,
        hidden: &[usize],
        outputs: usize,
        activation: Activation,
        head_gain: f64,
    ) -> Result<Self, S::Error> {
        let mut width = inputs;
        let mut layers = Vec::with_capacity(hidden.len());
        for (i, &next) in hidden.iter().enumerate() {
            layers.push(Linear::build(source, &path(prefix, &format!("l{i}")), width, next, SQRT_2)?);
            width = next;
        }
        Ok(Self { layers, head: Linear::build(source, &path(prefix, "head"), width, outputs, head_gain)?, activation })
    }

    /// Returns the input width.
    pub fn inputs(&self) -> usize {
        self.layers.first().unwrap_or(&self.head).weight.dims()[0]
    }

    /// Returns the last hidden layer's activations, `[n, inputs]` to `[n, hidden]`.
    pub fn features(&self, x: Tensor<2>) -> Tensor<2> {
        Linear::chain(x, &self.hidden().collect::<Vec<_>>())
    }

    /// Returns the hidden layers with their activations.
    fn hidden(&self) -> impl Iterator<Item = (&Linear, Option<Activation>)> {
        self.layers.iter().map(|layer| (layer, Some(self.activation)))
    }

    /// Returns [`Self::features`] of `[held, x]` joined, where row `b` of `held` `[B, H]` goes with the rows `t * B +
    /// b` of `x` `[steps * B, inputs - H]`.
    pub fn features_held(&self, held: Tensor<2>, x: Tensor<2>, steps: usize) -> Tensor<2> {
        let Some(first) = self.layers.first() else {
            return Tensor::cat(vec![held.repeat_dim(0, steps), x], 1);
        };
        let first = self.activation.forward(first.forward_held(held, x, steps));
        Linear::chain(first, &self.hidden().skip(1).collect::<Vec<_>>())
    }

    /// Maps `[n, inputs]` to `[n, outputs]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        Linear::chain(x, &self.hidden().chain([(&self.head, None)]).collect::<Vec<_>>())
    }
}

impl Parameters for Mlp {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        for (i, layer) in self.layers.iter_mut().enumerate() {
            layer.visit(&path(prefix, &format!("l{i}")), visitor);
        }
        self.head.visit(&path(prefix, "head"), visitor);
    }
}

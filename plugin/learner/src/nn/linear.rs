//! Linear layers, layer normalisation, and the multi-layer perceptron of both.

use crate::{
    LearnError,
    nn::{
        host,
        params::{Init, ParamSource, ParamVisitor, Parameters, RandomInit, path},
    },
};
use burn::tensor::{Device, Tensor, module::linear};
use playbot_kernels::{
    dense::{Dense, dense},
    elementwise::Activation,
};
use rand::Rng;
use std::f64::consts::SQRT_2;

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
    pub(crate) fn chain(x: Tensor<2>, layers: &[(&Self, Option<Activation>)]) -> Tensor<2> {
        let of_layers = layers.iter().map(|(layer, activation)| layer.dense(*activation));
        dense(&x, &of_layers.collect::<Vec<_>>()).unwrap_or_else(|| {
            layers.iter().fold(x, |x, (layer, activation)| match activation {
                Some(activation) => activation.forward(layer.plain(x)),
                None => layer.plain(x),
            })
        })
    }

    /// Returns the one output of a layer with one, `[n]`, in which no row depends on the others.
    pub(crate) fn number(&self, x: Tensor<2>) -> Tensor<1> {
        let fused = dense(&x, &[self.dense(None)]).map(|y| y.squeeze_dim(1));
        fused.unwrap_or_else(|| {
            // Backends sum a product with a single column in an order that depends on the number of rows.
            let weight = self.weight.clone().reshape([1, -1]);
            (x * weight).sum_dim(1).squeeze_dim(1) + self.bias.clone()
        })
    }

    fn dense(&self, activation: Option<Activation>) -> Dense<'_> {
        Dense { weight: &self.weight, bias: &self.bias, activation }
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
        let part = |rows, bias| Self { weight: self.weight.clone().slice([rows, 0..outputs]), bias };
        let rest = part(width..inputs, self.bias.clone()).forward(x);
        if width == 0 {
            return rest;
        }
        let without_bias = Tensor::zeros([outputs], &held.device());
        let held = part(0..width, without_bias).forward(held).reshape([1, batch, outputs]);
        (rest.reshape([steps, batch, outputs]) + held).reshape([steps * batch, outputs])
    }
}

impl Parameters for Linear {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        visitor.visit(&path(prefix, "weight"), &mut self.weight);
        visitor.visit(&path(prefix, "bias"), &mut self.bias);
    }
}

/// Added to the variance.
const EPS: f64 = 1e-6;

/// Brings each row to mean 0 and deviation 1, then scales and shifts each column (Ba et al. 2016, "Layer
/// normalization"): y = (x - mean) / √(var + 1e-6) · scale + shift.
#[derive(Clone, Debug)]
pub struct LayerNorm {
    /// `[width]`, ones at first.
    pub scale: Tensor<1>,
    /// `[width]`, zeros at first.
    pub shift: Tensor<1>,
}

impl LayerNorm {
    pub(crate) fn build<S: ParamSource>(source: &mut S, prefix: &str, width: usize) -> Result<Self, S::Error> {
        Ok(Self {
            scale: source.param(&path(prefix, "scale"), [width], Init::Ones)?,
            shift: source.param(&path(prefix, "shift"), [width], Init::Zeros)?,
        })
    }

    /// Maps `[n, width]` to `[n, width]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        let centred = x.clone() - x.mean_dim(1);
        let deviation = (centred.clone().square().mean_dim(1) + EPS).sqrt();
        centred / deviation * self.scale.clone().unsqueeze::<2>() + self.shift.clone().unsqueeze::<2>()
    }
}

impl Parameters for LayerNorm {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        visitor.visit(&path(prefix, "scale"), &mut self.scale);
        visitor.visit(&path(prefix, "shift"), &mut self.shift);
    }
}

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

    /// Adds inputs behind the others whose weights are 0: they change no output yet.
    pub(crate) fn add_inputs(&mut self, count: usize) {
        let first = self.layers.first_mut().unwrap_or(&mut self.head);
        let zeros = Tensor::zeros([count, first.weight.dims()[1]], &first.weight.device());
        first.weight = Tensor::cat(vec![first.weight.clone(), zeros], 0);
    }

    /// Returns the last hidden layer's activations, `[n, inputs]` to `[n, hidden]`.
    pub fn features(&self, x: Tensor<2>) -> Tensor<2> {
        Linear::chain(x, &self.hidden().collect::<Vec<_>>())
    }

    /// Marks in `alive`, for each hidden layer, the units through which a gradient goes for some of the first `rows` rows
    /// of `x`, `[n, inputs]`.
    ///
    /// # Errors
    /// [`LearnError::Device`] if the outputs cannot be read.
    pub(crate) fn mark_alive(
        &self,
        mut x: Tensor<2>,
        rows: usize,
        alive: &mut Vec<Vec<bool>>,
    ) -> Result<(), LearnError> {
        for (number, layer) in self.layers.iter().enumerate() {
            x = layer.activated(x, self.activation);
            let width = x.dims()[1];
            if alive.len() == number {
                alive.push(vec![false; width]);
            }
            for row in host(x.clone())?.chunks(width).take(rows) {
                let outputs = alive[number].iter_mut().zip(row);
                outputs.for_each(|(is_alive, &output)| *is_alive |= lets_through(self.activation, output));
            }
        }
        Ok(())
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

/// Distance from ±1 within which a tanh lets hardly any gradient through: 0.002 of it.
const SATURATED: f32 = 1e-3;

/// Returns whether a unit with this output lets gradients through.
fn lets_through(activation: Activation, output: f32) -> bool {
    match activation {
        Activation::Relu => output > 0.0,
        Activation::Tanh => output.abs() < 1.0 - SATURATED,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::{matrix, vector};

    #[test]
    fn by_hand() {
        let device = DeviceKind::Flex.plain();
        let norm =
            LayerNorm { scale: vector(vec![1.0, 2.0, 1.0], &device), shift: vector(vec![0.0, 0.5, 0.0], &device) };
        let rows = norm.forward(matrix(vec![1.0, 2.0, 3.0, 5.0, 5.0, 5.0], 2, 3, &device));
        let side = (1.5f32).sqrt();
        let expected = [-side, 0.5, side, 0.0, 0.5, 0.0];
        let found = host(rows.reshape([6])).expect("readable");
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}");
    }

    #[test]
    fn units_that_let_no_gradient_through_are_dead() {
        let device = DeviceKind::Flex.plain();
        // Three units: x, -x and -1, whatever x is.
        let layer =
            Linear { weight: matrix(vec![1.0, -1.0, 0.0], 1, 3, &device), bias: vector(vec![0.0, 0.0, -1.0], &device) };
        let head = Linear { weight: matrix(vec![0.0; 3], 3, 1, &device), bias: vector(vec![0.0], &device) };
        let alive = |activation, inputs: Vec<f32>, rows| {
            let net = Mlp { layers: vec![layer.clone()], head: head.clone(), activation };
            let (mut alive, n) = (Vec::new(), inputs.len());
            net.mark_alive(matrix(inputs, n, 1, &device), rows, &mut alive).expect("readable");
            alive
        };
        assert_eq!(alive(Activation::Relu, vec![2.0, -3.0], 2), [[true, true, false]]);
        assert_eq!(alive(Activation::Relu, vec![2.0, -3.0], 1), [[true, false, false]], "other rows do not count");
        assert_eq!(alive(Activation::Tanh, vec![9.0, -9.0], 2), [[false, false, true]]);
        assert_eq!(alive(Activation::Tanh, vec![9.0, 0.5], 2), [[true, true, true]]);
    }
}

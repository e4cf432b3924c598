//! The critics of SAC: two, or an ensemble.

use crate::ActionSpace;
use crate::nn::{ActionBatch, LayerNorm, Mlp, ParamSource, ParamVisitor, Parameters, RandomInit, path};
use crate::policy::NetShape;
use burn::tensor::{Device, Tensor};
use rand::Rng;

/// The shape of an ensemble of critics.
#[derive(Clone, Debug)]
pub(super) struct EnsembleShape {
    /// Input of each critic beside a continuous action, and its hidden layers.
    pub(super) net: NetShape,
    /// The action space.
    pub(super) space: ActionSpace,
    /// Number of critics.
    pub(super) critics: usize,
    /// True if hidden layers are normalised.
    pub(super) layer_norm: bool,
}

/// A Q-function.
///
/// Continuous: input `[z, s, a]`, one output. Discrete: input `[z, s]`, one output per choice.
#[derive(Clone, Debug)]
pub struct QNet {
    /// The layers.
    pub net: Mlp,
    /// Normalisation of each hidden layer before its activation; empty without it.
    pub norms: Vec<LayerNorm>,
}

impl QNet {
    fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        if self.norms.is_empty() {
            return self.net.forward(x);
        }
        let hidden = self.net.layers.iter().zip(&self.norms);
        let features = hidden.fold(x, |x, (layer, norm)| self.net.activation.forward(norm.forward(layer.forward(x))));
        self.net.head.forward(features)
    }
}

impl Parameters for QNet {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.net.visit(prefix, visitor);
        for (i, norm) in self.norms.iter_mut().enumerate() {
            norm.visit(&path(prefix, &norm_name(i)), visitor);
        }
    }
}

fn norm_name(layer: usize) -> String {
    format!("l{layer}.norm")
}

/// Q-functions `q1.*`, `q2.*`, ..., each a network of its own.
#[derive(Clone, Debug)]
pub struct Critics {
    /// Q₁, Q₂, ...
    pub nets: Vec<QNet>,
}

impl Critics {
    /// Creates two critics, with orthogonal weights, gain √2 in the hidden layers and 1 in the heads.
    pub fn new<R: Rng + ?Sized>(net: &NetShape, space: ActionSpace, rng: &mut R, device: &Device) -> Self {
        let twins = EnsembleShape { net: net.clone(), space, critics: 2, layer_norm: false };
        let Ok(critics) = Self::build(&mut RandomInit { rng, device }, "", &twins);
        critics
    }

    /// Creates critics with parameters out of `source`.
    pub(super) fn build<S: ParamSource>(source: &mut S, prefix: &str, shape: &EnsembleShape) -> Result<Self, S::Error> {
        let NetShape { hidden, activation, .. } = &shape.net;
        let (inputs, outputs) = match shape.space {
            ActionSpace::Discrete(choices) => (shape.net.inputs(), choices),
            ActionSpace::Continuous(dim) => (shape.net.inputs().saturating_add(dim), 1),
        };
        let mut nets = Vec::new();
        for i in 1..=shape.critics {
            let name = path(prefix, &format!("q{i}"));
            let net = Mlp::build(source, &name, inputs, hidden, outputs, *activation, 1.0)?;
            let normalised = hidden.iter().enumerate().filter(|_| shape.layer_norm);
            let norms = normalised.map(|(i, &width)| LayerNorm::build(source, &path(&name, &norm_name(i)), width));
            nets.push(QNet { net, norms: norms.collect::<Result<_, _>>()? });
        }
        Ok(Self { nets })
    }

    /// Returns the critics with the given numbers, from 0; all of them for an empty list.
    #[must_use]
    pub fn some(&self, numbers: &[usize]) -> Self {
        match numbers {
            [] => self.clone(),
            _ => Self { nets: numbers.iter().map(|&i| self.nets[i].clone()).collect() },
        }
    }

    /// Returns Q of all choices in each state `[z, s]` by each critic, `[n, choices]` each.
    pub fn of_choices(&self, inputs: Tensor<2>) -> Vec<Tensor<2>> {
        self.nets.iter().map(|q| q.forward(inputs.clone())).collect()
    }

    /// Returns Q of one vector `[n, dim]` in each state `[z, s]` by each critic, `[n]` each.
    pub fn of_vectors(&self, inputs: Tensor<2>, actions: Tensor<2>) -> Vec<Tensor<1>> {
        let joined = Tensor::cat(vec![inputs, actions], 1);
        self.nets.iter().map(|q| q.forward(joined.clone()).squeeze_dim(1)).collect()
    }

    /// Returns Q of the actions taken by each critic, `[n]` each.
    pub fn of_actions(&self, inputs: Tensor<2>, actions: &ActionBatch) -> Vec<Tensor<1>> {
        match actions {
            ActionBatch::Continuous(vectors) => self.of_vectors(inputs, vectors.clone()),
            ActionBatch::Discrete(index) => {
                let of_choices = self.of_choices(inputs).into_iter();
                of_choices.map(|q| q.gather(1, index.clone()).squeeze_dim(1)).collect()
            }
        }
    }
}

impl Parameters for Critics {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        for (i, q) in self.nets.iter_mut().enumerate() {
            q.visit(&path(prefix, &format!("q{}", i + 1)), visitor);
        }
    }
}

/// The reduction of several critics' values to one.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Pool {
    /// The least, which is no overestimate (Fujimoto et al. 2018).
    Least,
    /// The mean, for the actor of an ensemble (Chen et al. 2021, "Randomized ensembled double Q-learning").
    Mean,
}

impl Pool {
    /// Reduces the values of each critic, of which there is at least one, to one.
    pub(super) fn of<const D: usize>(self, values: Vec<Tensor<D>>) -> Tensor<D> {
        let count = values.len() as f64;
        let pooled = values.into_iter().reduce(|a, b| match self {
            Self::Least => a.min_pair(b),
            Self::Mean => a + b,
        });
        let pooled = pooled.expect("there is a critic");
        if self == Self::Mean { pooled / count } else { pooled }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::{Activation, host, matrix};
    use crate::rng::Streams;

    /// Width of the hidden layers.
    const WIDTH: usize = 16;

    fn critics(layer_norm: bool, device: &Device) -> Critics {
        let net = NetShape { obs_dim: 3, latent: 0, hidden: vec![WIDTH, WIDTH], activation: Activation::Relu };
        let shape = EnsembleShape { net, space: ActionSpace::Continuous(1), critics: 3, layer_norm };
        let mut rng = Streams::new(1).stream("critics", 0);
        let Ok(critics) = Critics::build(&mut RandomInit { rng: &mut rng, device }, "", &shape);
        critics
    }

    #[test]
    fn normalised_layers_bound_what_is_far_from_all_that_was_seen() {
        let device = DeviceKind::Flex.plain();
        let values = |critics: &Critics, far: f32| -> Vec<f32> {
            let states = matrix(vec![far, -2.0 * far, 3.0 * far], 1, 3, &device);
            let q = critics.of_vectors(states, matrix(vec![far], 1, 1, &device));
            q.into_iter().map(|q| host(q).expect("readable")[0]).collect()
        };
        let (plain, normalised) = (critics(false, &device), critics(true, &device));
        let [near, far] = [1.0, 1000.0].map(|size| (values(&plain, size), values(&normalised, size)));
        for (i, q) in normalised.nets.iter().enumerate() {
            assert!((far.0[i] / (1000.0 * near.0[i]) - 1.0).abs() < 0.01, "as far as states are: {near:?}, {far:?}");
            assert!((far.1[i] - near.1[i]).abs() < 1e-3, "whatever the distance: {near:?}, {far:?}");
            // No row of a normalised layer is longer than the root of its width, before the activation or behind it.
            let head = host(q.net.head.weight.clone().reshape([WIDTH])).expect("readable");
            let bound = (WIDTH as f32 * head.iter().map(|weight| weight * weight).sum::<f32>()).sqrt();
            assert!(far.1[i].abs() <= bound, "{} over {bound}", far.1[i]);
        }
    }
}

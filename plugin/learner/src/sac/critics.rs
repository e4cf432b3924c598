//! The networks of SAC: critics, two or an ensemble, with the actor, the temperature, and slow copies as targets.

use crate::{
    ActionSpace, FileError, LearnError,
    file::TensorFile,
    learner::LearnerBase,
    nn::{
        ActionBatch, Init, LayerNorm, Mlp, ParamSource, ParamVisitor, Parameters, RandomInit, frozen, path, tracked,
        vector,
    },
    policy::{Actor, ActorShape, NetShape, StdShape},
    sac::{EntropyCoef, SacConfig},
};
use burn::tensor::{Device, Tensor};
use rand::Rng;
use std::vec::IntoIter;

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
            ActionSpace::Mixed(mixed) => (shape.net.inputs().saturating_add(mixed.dim()), 1),
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
            // `SacConfig::check_space` refuses them.
            ActionBatch::Joint(_) => Vec::new(),
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

// The networks of SAC: an actor, critics and their targets, and the temperature.

/// The logarithm of the temperature, `[1]`; `log_alpha` in files.
#[derive(Clone, Debug)]
pub struct LogTemperature(pub Tensor<1>);

impl Parameters for LogTemperature {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        visitor.visit(&path(prefix, "log_alpha"), &mut self.0);
    }
}

/// All networks that SAC trains.
#[derive(Clone, Debug)]
pub struct SacNets {
    /// The policy, tracked.
    pub actor: Actor,
    /// The critics, tracked.
    pub critics: Critics,
    /// Their slow copies, not tracked.
    pub targets: Critics,
    /// The logarithm of the temperature, tracked; unused if that is fixed.
    pub log_temperature: LogTemperature,
}

impl SacNets {
    /// Creates a copy of the decoder, or starting weights from the stream `sac.actor`, and critics with some from
    /// `sac.critics`.
    ///
    /// # Errors
    /// Does not fail as long as observations are vectors.
    pub(super) fn fresh(config: &SacConfig, base: &LearnerBase) -> Result<Self, LearnError> {
        let (shape, device) = (actor_shape(config, base), base.device.plain());
        let actor = match base.copied_teacher() {
            Some(teacher) => teacher.origin().clone(),
            None => shape.fresh(&base.spec, &base.streams, "sac.actor", &device)?,
        };
        let mut rng = base.streams.stream("sac.critics", 0);
        let source = &mut RandomInit { rng: &mut rng, device: &device };
        let Ok(critics) = Critics::build(source, "", &ensemble(config, base));
        let initial = match config.entropy {
            EntropyCoef::Auto { initial, .. } => initial,
            EntropyCoef::Fixed(_) => 1.0,
        };
        let log_temperature = LogTemperature(vector(vec![libm::log(initial) as f32], &device));
        Ok(Self::tracked(&actor, &critics, &critics, &log_temperature))
    }

    /// Reads the networks of a checkpoint.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen.
    pub(super) fn stored(config: &SacConfig, base: &LearnerBase, file: &mut TensorFile) -> Result<Self, FileError> {
        let device = base.device.plain();
        let actor = actor_shape(config, base).stored(&base.spec, file, "actor", &device)?;
        let (shape, source) = (ensemble(config, base), &mut file.params(&device));
        let critics = Critics::build(source, "", &shape)?;
        let targets = Critics::build(source, "target", &shape)?;
        let log_temperature = LogTemperature(source.param("log_alpha", [1], Init::Zeros)?);
        Ok(Self::tracked(&actor, &critics, &targets, &log_temperature))
    }

    fn tracked(actor: &Actor, critics: &Critics, targets: &Critics, log_temperature: &LogTemperature) -> Self {
        Self {
            actor: tracked(actor),
            critics: tracked(critics),
            targets: frozen(targets),
            log_temperature: tracked(log_temperature),
        }
    }

    /// Returns the present weight of entropy.
    ///
    /// # Errors
    /// [`LearnError::Device`] if it cannot be read.
    pub fn temperature(&self) -> Result<f64, LearnError> {
        Ok(libm::exp(f64::from(crate::nn::scalar(self.log_temperature.0.clone().inner())?)))
    }
}

/// Returns the layers of the network that it copies, if it is a copy, else those of the settings.
fn actor_shape(config: &SacConfig, base: &LearnerBase) -> ActorShape {
    let (low, high) = config.log_std;
    match base.copied_teacher() {
        Some(teacher) => teacher.shape(),
        None => {
            let (net, std) = (actors_net(config, base), StdShape::Squashed(low, high));
            ActorShape { net, std, cnn: None, entities: None, memory: None }
        }
    }
}

/// Returns the critics that the settings describe.
fn ensemble(config: &SacConfig, base: &LearnerBase) -> EnsembleShape {
    let (shape, space) = (actors_net(config, base), base.spec.action_space);
    // Critics that count ticks read one number more.
    let net = NetShape { obs_dim: shape.obs_dim.saturating_add(clock_width(base)), ..shape };
    EnsembleShape { net, space, critics: config.critics, layer_norm: config.layer_norm }
}

/// Returns 1 if the critics read the remaining share of a skill's ticks, else 0.
pub(super) fn clock_width(base: &LearnerBase) -> usize {
    usize::from(base.score_config().is_some_and(|score| score.critic_clock))
}

/// Returns the input of the actor, and the hidden layers of all networks.
fn actors_net(config: &SacConfig, base: &LearnerBase) -> NetShape {
    NetShape {
        obs_dim: base.spec.obs.numbers(),
        latent: base.spec.latent,
        hidden: config.hidden.clone(),
        activation: config.activation,
    }
}

// Slow copies of networks.

/// Sets target = tau · source + (1 - tau) · target, parameter by parameter (Polyak averaging; a plain copy for tau =
/// 1).
///
/// `target` stays untracked. Both must be of one architecture.
pub fn soft_update<M: Parameters + Clone>(target: &mut M, source: &M, tau: f64) {
    let mut flat = Flat(Vec::new());
    source.clone().visit("", &mut flat);
    target.visit("", &mut Mix { source: flat.0.into_iter(), tau });
}

struct Flat(Vec<Tensor<1>>);

impl ParamVisitor for Flat {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        let len = tensor.dims().iter().product::<usize>();
        self.0.push(tensor.clone().inner().reshape([len]));
    }
}

struct Mix {
    source: IntoIter<Tensor<1>>,
    tau: f64,
}

impl ParamVisitor for Mix {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        let source = self.source.next().expect("one architecture, so as many parameters");
        let source = source.reshape(tensor.dims());
        let slow = tensor.clone().inner();
        *tensor = if self.tau < 1.0 { slow * (1.0 - self.tau) + source * self.tau } else { source };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::{host, matrix};
    use crate::rng::Streams;
    use playbot_kernels::elementwise::Activation;

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

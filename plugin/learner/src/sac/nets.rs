//! The networks of SAC: an actor, two critics and their targets, and the temperature.

use super::{EntropyCoef, SacConfig};
use crate::file::TensorFile;
use crate::learner::LearnerBase;
use crate::nn::{
    ActionBatch, Init, Mlp, ParamSource, ParamVisitor, Parameters, RandomInit, frozen, path, tracked, vector,
};
use crate::policy::{Actor, ActorShape, NetShape, StdShape};
use crate::{ActionSpace, FileError, LearnError};
use burn::tensor::{Device, Tensor};
use rand::Rng;

/// Twin Q-functions, `q1.*` and `q2.*`, each a network of its own.
///
/// Continuous: input `[z, s, a]`, one output. Discrete: input `[z, s]`, one output per choice.
#[derive(Clone, Debug)]
pub struct Critics {
    /// Q₁.
    pub q1: Mlp,
    /// Q₂.
    pub q2: Mlp,
}

impl Critics {
    /// Orthogonal weights, gain √2 in the hidden layers and 1 in the heads.
    pub fn new<R: Rng + ?Sized>(shape: &NetShape, space: ActionSpace, rng: &mut R, device: &Device) -> Self {
        let Ok(critics) = Self::build(&mut RandomInit { rng, device }, "", shape, space);
        critics
    }

    /// [`Self::new`] with parameters out of `source`.
    fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        shape: &NetShape,
        space: ActionSpace,
    ) -> Result<Self, S::Error> {
        let (inputs, outputs) = match space {
            ActionSpace::Discrete(choices) => (shape.inputs(), choices),
            ActionSpace::Continuous(dim) => (shape.inputs().saturating_add(dim), 1),
        };
        let mut net =
            |name: &str| Mlp::build(source, &path(prefix, name), inputs, &shape.hidden, outputs, shape.activation, 1.0);
        Ok(Self { q1: net("q1")?, q2: net("q2")? })
    }

    /// Q₁ and Q₂ of all choices in each state `[z, s]`, `[n, choices]` each.
    pub fn of_choices(&self, inputs: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
        (self.q1.forward(inputs.clone()), self.q2.forward(inputs))
    }

    /// Q₁ and Q₂ of one vector `[n, dim]` in each state `[z, s]`, `[n]` each.
    pub fn of_vectors(&self, inputs: Tensor<2>, actions: Tensor<2>) -> (Tensor<1>, Tensor<1>) {
        let joined = Tensor::cat(vec![inputs, actions], 1);
        (self.q1.forward(joined.clone()).squeeze_dim(1), self.q2.forward(joined).squeeze_dim(1))
    }

    /// Q₁ and Q₂ of the actions taken, `[n]` each.
    pub fn of_actions(&self, inputs: Tensor<2>, actions: &ActionBatch) -> (Tensor<1>, Tensor<1>) {
        match actions {
            ActionBatch::Continuous(vectors) => self.of_vectors(inputs, vectors.clone()),
            ActionBatch::Discrete(index) => {
                let (q1, q2) = self.of_choices(inputs);
                (q1.gather(1, index.clone()).squeeze_dim(1), q2.gather(1, index.clone()).squeeze_dim(1))
            }
        }
    }
}

impl Parameters for Critics {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.q1.visit(&path(prefix, "q1"), visitor);
        self.q2.visit(&path(prefix, "q2"), visitor);
    }
}

/// The logarithm of the temperature, `[1]`; `log_alpha` in files.
#[derive(Clone, Debug)]
pub struct LogTemperature(pub Tensor<1>);

impl Parameters for LogTemperature {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        visitor.visit(&path(prefix, "log_alpha"), &mut self.0);
    }
}

/// Everything that SAC trains.
#[derive(Clone, Debug)]
pub struct SacNets {
    /// The policy, tracked.
    pub actor: Actor,
    /// The critics, tracked.
    pub critics: Critics,
    /// Their slow copies, not tracked.
    pub targets: Critics,
    /// The logarithm of the temperature, tracked; does nothing where that is fixed.
    pub log_temperature: LogTemperature,
}

impl SacNets {
    /// A copy of the decoder, or starting weights from the stream `sac.actor`, and critics with some from `sac.critics`.
    ///
    /// # Errors
    /// None, as long as observations are vectors.
    pub(super) fn fresh(config: &SacConfig, base: &LearnerBase) -> Result<Self, LearnError> {
        let (shape, device) = (actor_shape(config, base), base.device.plain());
        let actor = match base.copied_teacher() {
            Some(teacher) => teacher.decoder().clone(),
            None => shape.fresh(&base.spec, &base.streams, "sac.actor", &device)?,
        };
        let mut rng = base.streams.stream("sac.critics", 0);
        let critics = Critics::new(&critic_shape(config, base), base.spec.action_space, &mut rng, &device);
        let initial = match config.entropy {
            EntropyCoef::Auto { initial, .. } => initial,
            EntropyCoef::Fixed(_) => 1.0,
        };
        let log_temperature = LogTemperature(vector(vec![initial.ln() as f32], &device));
        Ok(Self::tracked(&actor, &critics, &critics, &log_temperature))
    }

    /// Those of a checkpoint.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen.
    pub(super) fn stored(config: &SacConfig, base: &LearnerBase, file: &mut TensorFile) -> Result<Self, FileError> {
        let (device, space) = (base.device.plain(), base.spec.action_space);
        let actor = actor_shape(config, base).stored(&base.spec, file, "actor", &device)?;
        let (shape, source) = (critic_shape(config, base), &mut file.params(&device));
        let critics = Critics::build(source, "", &shape, space)?;
        let targets = Critics::build(source, "target", &shape, space)?;
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

    /// How much entropy is worth now.
    ///
    /// # Errors
    /// [`LearnError::Device`] if it cannot be read.
    pub fn temperature(&self) -> Result<f64, LearnError> {
        Ok(f64::from(crate::nn::scalar(self.log_temperature.0.clone().inner())?).exp())
    }
}

/// The decoder's layers for a copy of it, else those of the settings.
fn actor_shape(config: &SacConfig, base: &LearnerBase) -> ActorShape {
    let (low, high) = config.log_std;
    match base.copied_teacher() {
        Some(teacher) => teacher.description.decoder_shape(),
        None => ActorShape { net: critic_shape(config, base), std: StdShape::Squashed(low, high), cnn: None },
    }
}

/// What a critic reads beside a continuous action, and its hidden layers.
fn critic_shape(config: &SacConfig, base: &LearnerBase) -> NetShape {
    NetShape {
        obs_dim: base.spec.obs.numbers(),
        latent: base.spec.latent,
        hidden: config.hidden.clone(),
        activation: config.activation,
    }
}

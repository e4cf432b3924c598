//! The networks of SAC: an actor, critics and their targets, and the temperature.

use super::critics::EnsembleShape;
use super::{Critics, EntropyCoef, SacConfig};
use crate::file::TensorFile;
use crate::learner::LearnerBase;
use crate::nn::{Init, ParamSource, ParamVisitor, Parameters, RandomInit, frozen, path, tracked, vector};
use crate::policy::{Actor, ActorShape, NetShape, StdShape};
use crate::{FileError, LearnError};
use burn::tensor::Tensor;

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
        let log_temperature = LogTemperature(vector(vec![initial.ln() as f32], &device));
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
        Ok(f64::from(crate::nn::scalar(self.log_temperature.0.clone().inner())?).exp())
    }
}

/// Returns the layers of the network that it copies, if it is a copy, else those of the settings.
fn actor_shape(config: &SacConfig, base: &LearnerBase) -> ActorShape {
    let (low, high) = config.log_std;
    match base.copied_teacher() {
        Some(teacher) => teacher.shape(),
        None => ActorShape { net: actors_net(config, base), std: StdShape::Squashed(low, high), cnn: None },
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
